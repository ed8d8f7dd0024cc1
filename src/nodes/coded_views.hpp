#pragma once

#include <condition_variable>
#include <deque>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "fringe_fusion/calibration/cell_calibration.hpp"
#include "fringe_fusion/common/result.hpp"
#include "fringe_fusion/pose/match.hpp"
#include "fringe_fusion/pose/stations.hpp"

namespace fringe_fusion::nodes {

/// What is kept of the codes of one view: samples, because whole maps are large.
struct CodedView {
  std::string scan_id;
  int view_id = 0;
  std::string camera_frame;
  std::string projector_frame;
  CellCalibration calibration;
  std::vector<Match> matches;
  TrackSet projector_tracks;  ///< of a camera that moves before a projector at rest
  TrackSet camera_tracks;     ///< of a projector that moves before a camera at rest
};

/// Which views a caller asks for.
struct CodedViewsQuery {
  std::string scan_id;        ///< empty: the scan of the last view
  std::vector<int> view_ids;  ///< empty: all that are kept
};

/// The last coded views. Safe to use from several threads.
class CodedViews {
 public:
  using Pointer = std::shared_ptr<const CodedView>;

  explicit CodedViews(std::size_t max_views) : max_views_(max_views) {}

  /// A view that comes again replaces the former one; beyond max_views the oldest goes.
  void Add(CodedView view);
  void Clear();

  /// Waits until all views of the query are there, at most timeout_s.
  /// @return them by rising id, at least one; error naming scan and view that is missing, or two
  /// views with different calibrations.
  [[nodiscard]] Result<std::vector<Pointer>> Wait(const CodedViewsQuery& query, double timeout_s);

 private:
  /// Needs the lock. @return error naming what is missing.
  [[nodiscard]] Result<std::vector<Pointer>> Find(const CodedViewsQuery& query) const;

  std::size_t max_views_;
  std::mutex mutex_;
  std::condition_variable news_;
  std::deque<Pointer> views_;  ///< the oldest first
};

}  // namespace fringe_fusion::nodes
