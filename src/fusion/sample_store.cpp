#include "sample_store.hpp"

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <iterator>
#include <utility>

#include "sample_bytes.hpp"

namespace fringe_fusion::internal {
namespace {

constexpr int kPieceColumns = 4;
constexpr BlockKey kEndOfRuns = ~BlockKey{0};

int ColumnOf(BlockKey block) { return UnpackBlock(block)[0]; }

// The samples of the columns [first, last].
SampleSet Part(const SampleSet& set, int first, int last) {
  SampleSet part;
  for (std::size_t r = 0; r + 1 < set.runs.size(); ++r) {
    const int column = ColumnOf(set.runs[r].block);
    if (column < first || column > last) continue;
    part.runs.push_back({set.runs[r].block, static_cast<std::uint32_t>(part.samples.size())});
    part.samples.insert(part.samples.end(), set.samples.begin() + set.runs[r].begin,
                        set.samples.begin() + set.runs[r + 1].begin);
  }
  if (!part.runs.empty()) {
    part.runs.push_back({kEndOfRuns, static_cast<std::uint32_t>(part.samples.size())});
  }
  return part;
}

// Appends samples of later columns.
void Append(const SampleSet& part, SampleSet& set) {
  if (part.runs.empty()) return;
  if (!set.runs.empty()) set.runs.pop_back();
  const auto begin = static_cast<std::uint32_t>(set.samples.size());
  for (const SampleRun& run : part.runs) set.runs.push_back({run.block, run.begin + begin});
  set.samples.insert(set.samples.end(), part.samples.begin(), part.samples.end());
}

ViewSamples WithoutSamples(const ViewSamples& view) {
  ViewSamples empty;
  empty.id = view.id;
  empty.radius_voxels = view.radius_voxels;
  empty.has_pose_covariance = view.has_pose_covariance;
  empty.T_camera_object = view.T_camera_object;
  empty.pose_covariance = view.pose_covariance;
  return empty;
}

}  // namespace

void SampleStore::Count(const ViewSamples& view) {
  for (const SampleSet& set : view.levels) {
    for (std::size_t r = 0; r + 1 < set.runs.size(); ++r) {
      columns_[ColumnOf(set.runs[r].block)].sample_bytes +=
          (set.runs[r + 1].begin - set.runs[r].begin) * sizeof(Sample) + sizeof(SampleRun);
    }
  }
  const std::vector<BlockKey> blocks = TouchedBlocks(view, 0);
  std::vector<BlockKey> added;
  std::set_difference(blocks.begin(), blocks.end(), touched_.begin(), touched_.end(),
                      std::back_inserter(added));
  for (const BlockKey block : added) ++columns_[ColumnOf(block)].num_blocks;
  const auto middle = static_cast<std::ptrdiff_t>(touched_.size());
  touched_.insert(touched_.end(), added.begin(), added.end());
  std::inplace_merge(touched_.begin(), touched_.begin() + middle, touched_.end());
  max_radius_voxels_ = std::max(max_radius_voxels_, view.radius_voxels);
}

Status SampleStore::Add(const ViewSamples& view) {
  const std::vector<SampleRun>& runs = view.levels[0].runs;
  if (runs.size() < 2) return {};
  // The wider levels have the columns of level 0: they are merged from it.
  const int begin = ColumnOf(runs.front().block);
  const int end = ColumnOf(runs[runs.size() - 2].block);
  std::ofstream file(path_, std::ios::binary | (pieces_.empty() ? std::ios::trunc : std::ios::app));
  for (int first = begin; first <= end; first += kPieceColumns) {
    ViewSamples part = WithoutSamples(view);
    const int last = first + kPieceColumns - 1;
    for (std::size_t l = 0; l < part.levels.size(); ++l) {
      part.levels[l] = Part(view.levels[l], first, last);
    }
    if (part.levels[0].samples.empty()) continue;
    const std::string bytes = ToBytes(part);
    file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    pieces_.push_back({first, last, view.id, file_bytes_, bytes.size()});
    file_bytes_ += bytes.size();
  }
  file.close();
  if (!file) return Fail("{}: {}", path_, std::strerror(errno));
  Count(view);
  return {};
}

Result<std::map<int, ViewSamples>> SampleStore::Read(int first, int last) const {
  std::ifstream file(path_, std::ios::binary);
  std::map<int, ViewSamples> views;
  for (const Piece& piece : pieces_) {
    if (piece.last < first || piece.first > last) continue;
    std::string bytes(piece.size, '\0');
    file.seekg(static_cast<std::streamoff>(piece.begin));
    file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    if (!file) return Fail("{}: cannot be read: {}", path_, std::strerror(errno));
    const Result<ViewSamples> part = FromBytes(bytes);
    if (!part) return Fail("{}: {}", path_, part.error().message);
    const auto view = views.emplace(piece.view_id, WithoutSamples(*part)).first;
    for (std::size_t l = 0; l < part->levels.size(); ++l) {
      Append(part->levels[l], view->second.levels[l]);
    }
  }
  return views;
}

}  // namespace fringe_fusion::internal
