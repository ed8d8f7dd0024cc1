#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "view_samples.hpp"

namespace fringe_fusion::internal {

/// The samples of many views in a scratch file, to be read for a range of block columns. A column
/// is all blocks of one x.
class SampleStore {
 public:
  /// What is known of a column without reading it.
  struct Column {
    std::size_t sample_bytes = 0;  ///< in memory, all views and levels
    std::size_t num_blocks = 0;    ///< that hold a field
  };

  /// @param path file to write, replaced if it exists; it is the caller's to remove.
  explicit SampleStore(std::string path) : path_(std::move(path)) {}

  /// Appends the samples of a view. @return error naming the file and the cause.
  [[nodiscard]] Status Add(const ViewSamples& view);

  /// The samples that lie in the columns [first, last], and some beside them, by view id.
  [[nodiscard]] Result<std::map<int, ViewSamples>> Read(int first, int last) const;

  [[nodiscard]] const std::map<int, Column>& columns() const { return columns_; }
  [[nodiscard]] double max_radius_voxels() const { return max_radius_voxels_; }
  [[nodiscard]] std::size_t num_blocks() const { return touched_.size(); }
  [[nodiscard]] std::uint64_t file_bytes() const { return file_bytes_; }

 private:
  struct Piece {
    int first = 0;  // columns, both included
    int last = 0;
    int view_id = 0;
    std::uint64_t begin = 0;
    std::uint64_t size = 0;
  };
  void Count(const ViewSamples& view);

  std::string path_;
  std::vector<Piece> pieces_;      // in the order of writing: views, and columns within a view
  std::vector<BlockKey> touched_;  // ascending; eight bytes for each block of the model
  std::map<int, Column> columns_;
  double max_radius_voxels_ = 0.0;
  std::uint64_t file_bytes_ = 0;
};

}  // namespace fringe_fusion::internal
