#include "sample_bytes.hpp"

#include <cmath>
#include <cstring>
#include <type_traits>

namespace fringe_fusion::internal {
namespace {

constexpr std::uint32_t kVersion = 1;

class Writer {
 public:
  template <typename T>
  void Put(const T& value) {
    static_assert(std::is_arithmetic_v<T>);
    bytes_.append(reinterpret_cast<const char*>(&value), sizeof(T));
  }
  template <typename Derived>
  void PutMatrix(const Eigen::MatrixBase<Derived>& matrix) {
    for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
      for (Eigen::Index j = 0; j < matrix.cols(); ++j) Put(matrix(i, j));
    }
  }
  [[nodiscard]] std::string Take() { return std::move(bytes_); }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

// Reads past the end give zeros and leave ok() false.
class Reader {
 public:
  explicit Reader(const std::string& bytes, std::size_t size) : bytes_(bytes), size_(size) {}
  template <typename T>
  T Get() {
    T value{};
    if (size_ - at_ < sizeof(T)) {
      ok_ = false;
      return value;
    }
    std::memcpy(&value, bytes_.data() + at_, sizeof(T));
    at_ += sizeof(T);
    return value;
  }
  template <typename Matrix>
  void GetMatrix(Matrix&& matrix) {
    using Scalar = typename std::decay_t<Matrix>::Scalar;
    for (Eigen::Index i = 0; i < matrix.rows(); ++i) {
      for (Eigen::Index j = 0; j < matrix.cols(); ++j) matrix(i, j) = Get<Scalar>();
    }
  }
  [[nodiscard]] bool ok() const { return ok_; }
  [[nodiscard]] std::size_t left() const { return size_ - at_; }

 private:
  const std::string& bytes_;
  std::size_t size_;
  std::size_t at_ = 0;
  bool ok_ = true;
};

constexpr std::size_t kSampleBytes = 10 * sizeof(float) + 3;
constexpr std::size_t kRunBytes = sizeof(BlockKey) + sizeof(std::uint32_t);

void PutSet(const SampleSet& set, Writer& writer) {
  writer.Put(static_cast<std::uint64_t>(set.samples.size()));
  for (const Sample& sample : set.samples) {
    writer.PutMatrix(sample.position);
    writer.PutMatrix(sample.normal);
    for (const float value :
         {sample.weight, sample.weight_variance, sample.offset_normal, sample.offset_squared}) {
      writer.Put(value);
    }
    for (const std::uint8_t channel : {sample.color.r, sample.color.g, sample.color.b}) {
      writer.Put(channel);
    }
  }
  writer.Put(static_cast<std::uint64_t>(set.runs.size()));
  for (const SampleRun& run : set.runs) {
    writer.Put(run.block);
    writer.Put(run.begin);
  }
}

bool IsSound(const SampleSet& set) {
  for (const Sample& sample : set.samples) {
    const bool inside = sample.position.minCoeff() >= 0.0F && sample.position.maxCoeff() <= 8.0F;
    if (!inside || !sample.normal.allFinite() || !(sample.weight > 0.0F)) return false;
  }
  if (set.runs.empty()) return set.samples.empty();
  for (std::size_t i = 0; i + 1 < set.runs.size(); ++i) {
    const bool ascending =
        set.runs[i].block < set.runs[i + 1].block && set.runs[i].begin < set.runs[i + 1].begin;
    if (!ascending) return false;
  }
  return set.runs.front().begin == 0 && set.runs.back().block == ~BlockKey{0} &&
         set.runs.back().begin == set.samples.size();
}

bool GetSet(Reader& reader, SampleSet& set) {
  const auto num_samples = reader.Get<std::uint64_t>();
  if (num_samples > reader.left() / kSampleBytes) return false;
  set.samples.resize(num_samples);
  for (Sample& sample : set.samples) {
    reader.GetMatrix(sample.position);
    reader.GetMatrix(sample.normal);
    sample.weight = reader.Get<float>();
    sample.weight_variance = reader.Get<float>();
    sample.offset_normal = reader.Get<float>();
    sample.offset_squared = reader.Get<float>();
    sample.color.r = reader.Get<std::uint8_t>();
    sample.color.g = reader.Get<std::uint8_t>();
    sample.color.b = reader.Get<std::uint8_t>();
  }
  const auto num_runs = reader.Get<std::uint64_t>();
  if (num_runs > reader.left() / kRunBytes) return false;
  set.runs.resize(num_runs);
  for (SampleRun& run : set.runs) {
    run.block = reader.Get<BlockKey>();
    run.begin = reader.Get<std::uint32_t>();
  }
  return reader.ok() && IsSound(set);
}

// FNV-1a: finds damage, not malice.
std::uint64_t Checksum(const std::string& bytes, std::size_t size) {
  std::uint64_t sum = 14695981039346656037U;
  for (std::size_t i = 0; i < size; ++i) {
    sum = (sum ^ static_cast<unsigned char>(bytes[i])) * 1099511628211U;
  }
  return sum;
}

}  // namespace

std::string ToBytes(const ViewSamples& view) {
  Writer writer;
  writer.Put(kVersion);
  writer.Put(static_cast<std::int32_t>(view.id));
  writer.Put(view.radius_voxels);
  writer.Put(static_cast<std::uint8_t>(view.has_pose_covariance ? 1 : 0));
  writer.PutMatrix(view.T_camera_object.matrix());
  writer.PutMatrix(view.pose_covariance);
  for (const SampleSet& set : view.levels) PutSet(set, writer);
  writer.Put(Checksum(writer.bytes(), writer.bytes().size()));
  return writer.Take();
}

Result<ViewSamples> FromBytes(const std::string& bytes) {
  constexpr std::size_t kSumBytes = sizeof(std::uint64_t);
  if (bytes.size() < kSumBytes) return Fail("{} bytes of samples are cut off", bytes.size());
  const std::size_t size = bytes.size() - kSumBytes;
  std::uint64_t sum = 0;
  std::memcpy(&sum, bytes.data() + size, kSumBytes);
  if (sum != Checksum(bytes, size)) return Fail("the checksum of {} bytes is wrong", size);
  Reader reader(bytes, size);
  const auto version = reader.Get<std::uint32_t>();
  if (version != kVersion) return Fail("samples of version {}, must be {}", version, kVersion);
  ViewSamples view;
  view.id = reader.Get<std::int32_t>();
  view.radius_voxels = reader.Get<double>();
  view.has_pose_covariance = reader.Get<std::uint8_t>() != 0;
  Eigen::Matrix4d T;
  reader.GetMatrix(T);
  view.T_camera_object.matrix() = T;
  reader.GetMatrix(view.pose_covariance);
  const bool finite = T.allFinite() && view.pose_covariance.allFinite();
  constexpr double kMaxRadius = 64.0;
  if (!finite || !(view.radius_voxels > 0.0 && view.radius_voxels < kMaxRadius)) {
    return Fail("view {}: pose or radius {} is out of bounds", view.id, view.radius_voxels);
  }
  for (SampleSet& set : view.levels) {
    if (!GetSet(reader, set)) return Fail("view {}: the samples are damaged", view.id);
  }
  return view;
}

}  // namespace fringe_fusion::internal
