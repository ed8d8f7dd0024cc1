#include "fringe_fusion/surface/fuse_slabs.hpp"

#include <stdlib.h>  // mkdtemp

#include <algorithm>
#include <array>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "common/constants.hpp"
#include "fusion/sample_store.hpp"
#include "fusion/slab_field.hpp"
#include "mesh_stitcher.hpp"

namespace fringe_fusion {
namespace {

using internal::SampleStore;
using internal::SlabRange;

// A folder that goes with the work.
class ScratchFolder {
 public:
  static Result<std::unique_ptr<ScratchFolder>> Create(const std::string& parent) {
    std::error_code error;
    std::filesystem::path folder = parent;
    if (parent.empty()) folder = std::filesystem::temp_directory_path(error);
    std::string path = (folder / "fringe_fusion_slabs_XXXXXX").string();
    if (error || ::mkdtemp(path.data()) == nullptr) {
      return Fail("{}: no scratch folder: {}", folder.string(), std::strerror(errno));
    }
    return std::unique_ptr<ScratchFolder>(new ScratchFolder(path));
  }
  ~ScratchFolder() {
    std::error_code ignored;
    std::filesystem::remove_all(path_, ignored);
  }
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  [[nodiscard]] std::string operator/(const std::string& name) const { return path_ + "/" + name; }
  [[nodiscard]] const std::string& path() const { return path_; }

 private:
  explicit ScratchFolder(std::string path) : path_(std::move(path)) {}
  std::string path_;
};

double SecondsAfter(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

Result<SampleStore> StoreViews(const SlabJob& job, int num_views, const ViewReader& read,
                               const std::string& path, SlabFigures& figures) {
  SampleStore store(path);
  std::set<int> ids;
  for (int i = 0; i < num_views; ++i) {
    const Result<View> view = read(i);
    if (!view) return Forward(view);
    if (!ids.insert(view->id).second) {
      return Fail("view {} ({}): a view with this id is there already", view->id, view->name);
    }
    const Result<CropResult> cropped = CropView(*view, job.crop);
    if (!cropped) return Forward(cropped);
    const int num_dropped =
        cropped->num_outside_box + cropped->num_on_plane + cropped->num_on_fixture;
    if (cropped->num_kept == 0 && num_dropped > 0) continue;
    const auto samples = internal::MakeViewSamples(cropped->view, job.fusion);
    if (!samples) return Forward(samples);
    if (Status status = store.Add(*samples); !status) return Forward(status);
    ++figures.num_views;
    figures.num_points += static_cast<std::size_t>(cropped->num_kept);
  }
  if (store.columns().empty()) {
    return Fail("fusion: no point of {} views remains after cropping", num_views);
  }
  figures.num_blocks = store.num_blocks();
  figures.scratch_bytes = store.file_bytes();
  return store;
}

// Memory of a slab with its margin [B].
double SlabBytes(const SampleStore& store, const SlabRange& range, int margin) {
  constexpr int kFieldMargin = 2;
  double bytes = 0.0;
  const auto& columns = store.columns();
  for (auto column = columns.lower_bound(range.first - margin);
       column != columns.end() && column->first <= range.last + margin; ++column) {
    bytes += static_cast<double>(column->second.sample_bytes);
    const bool in_field =
        column->first >= range.first - kFieldMargin && column->first <= range.last + kFieldMargin;
    if (in_field) {
      bytes += static_cast<double>(column->second.num_blocks * internal::SlabBlockBytes());
    }
  }
  return bytes;
}

Result<std::vector<SlabRange>> DivideIntoSlabs(const SampleStore& store, const SlabJob& job) {
  const int margin = internal::SlabMargin(job.fusion, store.max_radius_voxels());
  const double limit = job.fusion.max_memory_gb * kBytesPerGb;
  const int last = store.columns().rbegin()->first;
  std::vector<SlabRange> slabs;
  for (int first = store.columns().begin()->first; first <= last;) {
    SlabRange range{first, first};
    const double needed = SlabBytes(store, range, margin);
    if (needed > limit) {
      return Fail(
          "fusion: voxel_m = {} needs {:.2f} GB for one column of blocks, limit max_memory_gb = "
          "{}; use max_memory_gb >= {:.3g} or voxel_m >= {:.3g}",
          job.fusion.voxel_m, needed / kBytesPerGb, job.fusion.max_memory_gb,
          1.1 * needed / kBytesPerGb, 1.1 * job.fusion.voxel_m * std::sqrt(needed / limit));
    }
    while (range.last < last &&
           (job.max_columns <= 0 || range.last - range.first + 1 < job.max_columns) &&
           SlabBytes(store, {range.first, range.last + 1}, margin) <= limit) {
      ++range.last;
    }
    slabs.push_back(range);
    first = range.last + 1;
  }
  return slabs;
}

// The middle one of many positive numbers, kept in a file.
class MedianFile {
 public:
  explicit MedianFile(std::string path)
      : path_(std::move(path)), file_(path_, std::ios::binary | std::ios::trunc) {}

  Status Add(const std::vector<float>& values) {
    for (const float value : values) ++high_[BitsOf(value) >> 16];
    file_.write(reinterpret_cast<const char*>(values.data()),
                static_cast<std::streamsize>(values.size() * sizeof(float)));
    file_.flush();
    count_ += values.size();
    if (!file_) return Fail("{}: {}", path_, std::strerror(errno));
    return {};
  }

  // The bits of positive numbers are in their order: first the bucket of the upper half.
  Result<float> Median() const {
    if (count_ == 0) return 0.0F;
    std::uint64_t rank = count_ / 2;
    const std::uint32_t bucket = Find(high_, rank);
    std::vector<std::uint64_t> low(kBuckets, 0);
    std::ifstream file(path_, std::ios::binary);
    std::vector<float> values(1 << 16);
    for (std::uint64_t done = 0; done < count_;) {
      const std::uint64_t rows = std::min<std::uint64_t>(values.size(), count_ - done);
      file.read(reinterpret_cast<char*>(values.data()),
                static_cast<std::streamsize>(rows * sizeof(float)));
      if (!file) return Fail("{}: cannot be read: {}", path_, std::strerror(errno));
      for (std::uint64_t i = 0; i < rows; ++i) {
        const std::uint32_t bits = BitsOf(values[i]);
        if (bits >> 16 == bucket) ++low[bits & 0xFFFFU];
      }
      done += rows;
    }
    const std::uint32_t bits = (bucket << 16) | Find(low, rank);
    float median = 0.0F;
    std::memcpy(&median, &bits, sizeof(median));
    return median;
  }

 private:
  static constexpr std::size_t kBuckets = 1 << 16;
  static std::uint32_t BitsOf(float value) {
    std::uint32_t bits = 0;
    std::memcpy(&bits, &value, sizeof(bits));
    return bits;
  }
  // The bucket of a rank, which becomes the rank within it.
  static std::uint32_t Find(const std::vector<std::uint64_t>& counts, std::uint64_t& rank) {
    std::uint32_t bucket = 0;
    while (rank >= counts[bucket]) rank -= counts[bucket++];
    return bucket;
  }

  std::string path_;
  std::ofstream file_;
  std::vector<std::uint64_t> high_ = std::vector<std::uint64_t>(kBuckets, 0);
  std::uint64_t count_ = 0;
};

// The weight below which the surface stays open, as the whole model has it.
Result<float> MinWeight(const SampleStore& store, const std::vector<SlabRange>& slabs,
                        const SlabJob& job, const std::string& path, const Progress& progress) {
  FusionConfig first_level = job.fusion;
  first_level.num_levels = 1;
  const int margin = internal::SlabMargin(first_level, store.max_radius_voxels());
  MedianFile weights(path);
  for (std::size_t i = 0; i < slabs.size(); ++i) {
    if (!progress("weigh", static_cast<double>(i) / static_cast<double>(slabs.size()))) {
      return Fail("{}", kCancelled);
    }
    auto views = store.Read(slabs[i].first - margin, slabs[i].last + margin);
    if (!views) return Forward(views);
    const auto of_slab = internal::SlabWeights(job.fusion, std::move(*views), slabs[i], NoProgress);
    if (!of_slab) return Forward(of_slab);
    if (Status status = weights.Add(*of_slab); !status) return Forward(status);
  }
  const Result<float> median = weights.Median();
  if (!median) return median;
  return static_cast<float>(job.fusion.min_weight_ratio) * *median;
}

Status ExtractSlabs(const SampleStore& store, const std::vector<SlabRange>& slabs,
                    const SlabJob& job, float min_weight, internal::MeshStitcher& stitcher,
                    const Progress& progress) {
  const int margin = internal::SlabMargin(job.fusion, store.max_radius_voxels());
  for (std::size_t i = 0; i < slabs.size(); ++i) {
    if (!progress("extract", static_cast<double>(i) / static_cast<double>(slabs.size()))) {
      return Fail("{}", kCancelled);
    }
    auto views = store.Read(slabs[i].first - margin, slabs[i].last + margin);
    if (!views) return Forward(views);
    const auto field =
        internal::SlabField::Make(job.fusion, std::move(*views), slabs[i], min_weight, NoProgress);
    if (!field) return Forward(field);
    const auto mesh = internal::ExtractEdgeMesh(*field, NoProgress);
    if (!mesh) return Forward(mesh);
    const int end_x = (slabs[i].last + 1) * VoxelField::kBlockSize;
    if (Status status = stitcher.Add(*mesh, end_x); !status) return status;
  }
  return {};
}

Status CheckJob(const SlabJob& job) {
  if (Status status = CheckBounds(job.fusion, "fusion"); !status) return status;
  if (job.fusion.order == 1) return Fail("fusion: order = 1 is not defined; use 0 or 2");
  if (Status status = CheckBounds(job.surface, "surface"); !status) return status;
  if (std::filesystem::path(job.mesh_path).extension() == ".ply") return {};
  return Fail("{}: a mesh in slabs is written as .ply alone", job.mesh_path);
}

}  // namespace

Result<SlabFigures> FuseSlabs(const SlabJob& job, int num_views, const ViewReader& read,
                              const Progress& progress) {
  if (Status status = CheckJob(job); !status) return Forward(status);
  if (num_views < 1) return Fail("fusion: no views");
  const auto scratch = ScratchFolder::Create(job.scratch_folder);
  if (!scratch) return Forward(scratch);
  SlabFigures figures;
  auto start = std::chrono::steady_clock::now();
  const ViewReader read_and_report = [&](int index) -> Result<View> {
    if (!progress("prepare views", static_cast<double>(index) / num_views)) {
      return Fail("{}", kCancelled);
    }
    return read(index);
  };
  const auto store =
      StoreViews(job, num_views, read_and_report, **scratch / "samples.bin", figures);
  if (!store) return Forward(store);
  figures.read_s = SecondsAfter(start);
  const auto slabs = DivideIntoSlabs(*store, job);
  if (!slabs) return Forward(slabs);
  figures.num_slabs = static_cast<int>(slabs->size());

  start = std::chrono::steady_clock::now();
  const auto min_weight = MinWeight(*store, *slabs, job, **scratch / "weights.bin", progress);
  if (!min_weight) return Forward(min_weight);
  figures.weigh_s = SecondsAfter(start);

  start = std::chrono::steady_clock::now();
  internal::MeshStitcher stitcher((*scratch)->path());
  Status status = ExtractSlabs(*store, *slabs, job, *min_weight, stitcher, progress);
  if (!status) return Forward(status);
  const auto mesh = stitcher.Finish(job.mesh_path, job.surface.min_component_faces);
  if (!mesh) return Forward(mesh);
  figures.num_vertices = mesh->num_vertices;
  figures.num_faces = mesh->num_faces;
  figures.extract_s = SecondsAfter(start);
  return figures;
}

}  // namespace fringe_fusion
