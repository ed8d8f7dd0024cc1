#include "charuco_marker.hpp"

#include <opencv2/aruco.hpp>

namespace fringe_fusion::internal {

Image<std::uint8_t> MarkerModules(int dictionary, int id) {
  const cv::Ptr<cv::aruco::Dictionary> markers = cv::aruco::getPredefinedDictionary(dictionary);
  cv::Mat picture;
  const int size = markers->markerSize + 2;
  markers->drawMarker(id, size, picture, 1);
  Image<std::uint8_t> modules(size, size);
  for (int y = 0; y < size; ++y) {
    for (int x = 0; x < size; ++x) modules(x, y) = picture.at<std::uint8_t>(y, x);
  }
  return modules;
}

int NumMarkers(int dictionary) {
  return cv::aruco::getPredefinedDictionary(dictionary)->bytesList.rows;
}

std::vector<FoundMarker> FindMarkers(const Image<std::uint8_t>& picture, int dictionary) {
  // OpenCV takes non-const pixels but only reads them.
  const cv::Mat view(picture.height(), picture.width(), CV_8U,
                     const_cast<std::uint8_t*>(picture.data()));
  std::vector<std::vector<cv::Point2f>> corners;
  std::vector<int> ids;
  cv::aruco::detectMarkers(view, cv::aruco::getPredefinedDictionary(dictionary), corners, ids);
  std::vector<FoundMarker> found;
  for (std::size_t i = 0; i < ids.size(); ++i) {
    FoundMarker marker;
    marker.id = ids[i];
    for (const cv::Point2f& corner : corners[i]) {
      marker.centre += 0.25 * Eigen::Vector2d(corner.x, corner.y);
    }
    found.push_back(marker);
  }
  return found;
}

}  // namespace fringe_fusion::internal
