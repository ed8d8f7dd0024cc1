#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "fringe_fusion/capture/image_stack.hpp"
#include "fringe_fusion/common/progress.hpp"
#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/geometry/transform.hpp"
#include "fringe_fusion/surface/mesh.hpp"

namespace fringe_fusion::ros_io {

/// The complete frames of one view and the frame that they are expressed in.
struct BagStack {
  ImageStack stack;
  std::string camera_frame;  ///< the camera's optical frame in tf
};

/// Reads what a recorded scan consists of: frames with their patterns, both CameraInfo topics and
/// tf; and point clouds. A topic is named by its full name, or by "" when the bag has only one of
/// the kind.
class BagReader {
 public:
  /// @return error naming the file when it is missing, truncated or no bag.
  [[nodiscard]] static Result<BagReader> Open(const std::string& path);
  BagReader(BagReader&&) noexcept;
  BagReader& operator=(BagReader&&) noexcept;
  ~BagReader();

  /// All topics as "name (type)", sorted.
  [[nodiscard]] std::vector<std::string> Topics() const;

  /// Camera, projector and the transform between their optical frames.
  /// @param camera_info_topic, projector_info_topic "" finds those whose names end in camera_info
  /// and projector_info.
  /// @return error naming the topic, or the frame that tf lacks.
  [[nodiscard]] Result<CellCalibration> ReadCalibration(const std::string& camera_info_topic,
                                                        const std::string& projector_info_topic);

  /// Hands over every view as soon as its last frame was read, so that one view at a time is in
  /// memory. A frame that was recorded twice counts as it was recorded last.
  /// @param scan_id of the frames to read, others are passed over; "": the bag must have one scan.
  /// @param take its failure ends the reading and is returned.
  /// @return error when the topic is absent, frames of a view are missing, or on cancel; when
  /// scan_id is not in the bag or "" leaves the choice open, it lists the ids that are.
  [[nodiscard]] Status ReadStacks(const std::string& frames_topic, const std::string& scan_id,
                                  const std::function<Status(BagStack)>& take,
                                  const Progress& progress = NoProgress);

  /// Whether tf knows the frame at any time.
  [[nodiscard]] bool HasFrame(const std::string& frame);
  /// T_target_source at a stamp from /tf and /tf_static.
  /// @return error with the words of tf.
  [[nodiscard]] Result<Transform> LookupTransform(const std::string& target,
                                                  const std::string& source, std::int64_t stamp_ns);

  /// The first PointCloud2 of a topic as points without faces, with colour where it has some;
  /// points that are not finite are left out.
  /// @return error naming bag and topic.
  [[nodiscard]] Result<Mesh> ReadCloud(const std::string& topic);

 private:
  struct Impl;
  explicit BagReader(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace fringe_fusion::ros_io
