#include "fringe_fusion/fusion/model_file.hpp"

#include <openvdb/io/Stream.h>
#include <openvdb/openvdb.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <utility>

#include "fringe_fusion/io/file.hpp"
#include "model_impl.hpp"
#include "sample_bytes.hpp"

namespace fringe_fusion {
namespace {

constexpr const char* kFormatKey = "fringe_fusion.format";
constexpr const char* kFormat = "implicit_model 1";
constexpr const char* kScanKey = "fringe_fusion.scan_id";
constexpr const char* kRevisionKey = "fringe_fusion.pose_revision";
constexpr const char* kConfigPrefix = "fringe_fusion.fusion.";
constexpr const char* kViewPrefix = "fringe_fusion.view.";

// Writes and reads the settings by their Visit.
struct PutSettings {
  openvdb::MetaMap& metadata;
  template <typename T, typename... Bounds>
  void operator()(const char* name, const T& value, const Bounds&... /*bounds*/) const {
    metadata.insertMeta(std::string(kConfigPrefix) + name,
                        openvdb::DoubleMetadata(static_cast<double>(value)));
  }
};
struct GetSettings {
  const openvdb::MetaMap& metadata;
  std::string missing;
  template <typename T, typename... Bounds>
  void operator()(const char* name, T& value, const Bounds&... /*bounds*/) {
    const auto found =
        metadata.getMetadata<openvdb::DoubleMetadata>(kConfigPrefix + std::string(name));
    if (!found) {
      missing = name;
      return;
    }
    value = static_cast<T>(found->value());
  }
};

openvdb::FloatGrid::Ptr MakeGrid(const char* name, float background, double voxel_m) {
  auto grid = openvdb::FloatGrid::create(background);
  grid->setName(name);
  grid->setTransform(openvdb::math::Transform::createLinearTransform(voxel_m));
  return grid;
}

openvdb::GridPtrVec MakeGrids(const ImplicitModel& model) {
  const double voxel_m = model.config().voxel_m;
  constexpr double kBackgroundVoxels = 4.0;
  auto distance = MakeGrid("distance", static_cast<float>(kBackgroundVoxels * voxel_m), voxel_m);
  auto sigma = MakeGrid("sigma", 0.0F, voxel_m);
  auto distances = distance->getAccessor();
  auto sigmas = sigma->getAccessor();
  for (const ImplicitModel::BlockIndex& block : model.Blocks()) {
    for (int i = 0; i < internal::kVoxelsPerBlock; ++i) {
      const std::array<int, 3> voxel{block[0] * 8 + i % 8, block[1] * 8 + i / 8 % 8,
                                     block[2] * 8 + i / 64};
      const FieldSample at = model.AtVoxel(voxel);
      if (!at.supported) continue;
      const openvdb::Coord coordinate(voxel[0], voxel[1], voxel[2]);
      distances.setValue(coordinate, at.distance);
      sigmas.setValue(coordinate, at.sigma);
    }
  }
  return {distance, sigma};
}

openvdb::MetaMap MakeMetadata(const ImplicitModel& model, const ModelOrigin& origin) {
  openvdb::MetaMap metadata;
  metadata.insertMeta(kFormatKey, openvdb::StringMetadata(kFormat));
  metadata.insertMeta(kScanKey, openvdb::StringMetadata(origin.scan_id));
  metadata.insertMeta(kRevisionKey, openvdb::Int64Metadata(origin.pose_revision));
  FusionConfig config = model.config();
  config.Visit(PutSettings{metadata});
  for (const auto& [id, view] : model.impl().views) {
    metadata.insertMeta(kViewPrefix + std::to_string(id),
                        openvdb::StringMetadata(internal::ToBytes(view)));
  }
  return metadata;
}

Result<openvdb::MetaMap> ReadMetadata(const std::string& path) {
  std::error_code ignored;
  if (std::filesystem::is_directory(path, ignored)) return Fail("'{}': is a folder", path);
  std::ifstream file(path, std::ios::binary);
  if (!file) return Fail("'{}': cannot be opened: {}", path, std::strerror(errno));
  try {
    openvdb::initialize();
    openvdb::io::Stream stream(file, /*delayLoad=*/false);
    const openvdb::MetaMap::Ptr metadata = stream.getMetadata();
    if (!metadata) return Fail("{}: has no metadata", path);
    return openvdb::MetaMap(*metadata);
  } catch (const std::exception& error) {
    return Fail("{}: is no whole .vdb file ({})", path, error.what());
  }
}

}  // namespace

Status SaveModel(const ImplicitModel& model, const std::string& path, const ModelOrigin& origin) {
  if (std::filesystem::path(path).extension() != ".vdb") {
    return Fail("'{}': the file of a model must end in .vdb", path);
  }
  return WriteAtomically(path, [&](std::ostream& out) -> Status {
    try {
      openvdb::initialize();
      const openvdb::io::Stream stream(out);
      stream.write(MakeGrids(model), MakeMetadata(model, origin));
    } catch (const std::exception& error) {
      return Fail("{}: {}", path, error.what());
    }
    return {};
  });
}

Result<SavedModel> LoadModel(const std::string& path, const Progress& progress) {
  const Result<openvdb::MetaMap> metadata = ReadMetadata(path);
  if (!metadata) return Forward(metadata);
  const auto format = metadata->getMetadata<openvdb::StringMetadata>(kFormatKey);
  if (!format || format->value() != kFormat) {
    return Fail("{}: is no model of this program: {} is '{}', must be '{}'", path, kFormatKey,
                format ? format->value() : "", kFormat);
  }
  const auto scan_id = metadata->getMetadata<openvdb::StringMetadata>(kScanKey);
  const auto revision = metadata->getMetadata<openvdb::Int64Metadata>(kRevisionKey);
  if (!scan_id || !revision) return Fail("{}: does not say of which scan it is", path);
  FusionConfig config;
  GetSettings settings{*metadata, {}};
  config.Visit(settings);
  if (!settings.missing.empty()) return Fail("{}: has no setting {}", path, settings.missing);
  std::vector<internal::ViewSamples> views;
  for (auto item = metadata->beginMeta(); item != metadata->endMeta(); ++item) {
    if (item->first.rfind(kViewPrefix, 0) != 0) continue;
    const auto bytes = metadata->getMetadata<openvdb::StringMetadata>(item->first);
    if (!bytes) return Fail("{}: {} is not made of bytes", path, item->first);
    Result<internal::ViewSamples> view = internal::FromBytes(bytes->value());
    if (!view) return Fail("{}: {}: {}", path, item->first, view.error().message);
    views.push_back(std::move(*view));
  }
  Result<ImplicitModel> model = ImplicitModel::FromSamples(config, std::move(views), progress);
  if (!model) return Fail("{}: {}", path, model.error().message);
  return SavedModel{std::move(*model),
                    {scan_id->value(), static_cast<std::uint32_t>(revision->value())}};
}

}  // namespace fringe_fusion
