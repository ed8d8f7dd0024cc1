#include <array>
#include <filesystem>
#include <limits>

#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/image_io.hpp"
#include "fringe_fusion/io/scan_folder.hpp"

namespace fringe_fusion {
namespace {

namespace fs = std::filesystem;

// The float layers of a phase map and the files they live in.
struct Layer {
  const char* file;
  Image<float> PhaseMap::*image;
  bool required;
  bool PhaseMap::*relative = nullptr;  ///< set where the file name says that values are relative
};
// Relative coordinates have names of their own: no reader takes them for absolute ones.
constexpr std::array<Layer, 9> kLayers = {
    {{"u.tiff", &PhaseMap::u, false},
     {"v.tiff", &PhaseMap::v, false},
     {"relative_u.tiff", &PhaseMap::u, false, &PhaseMap::relative_u},
     {"relative_v.tiff", &PhaseMap::v, false, &PhaseMap::relative_v},
     {"sigma_u.tiff", &PhaseMap::sigma_u, false},
     {"sigma_v.tiff", &PhaseMap::sigma_v, false},
     {"offset.tiff", &PhaseMap::offset, false},
     {"modulation.tiff", &PhaseMap::modulation, true},
     {"order_error.tiff", &PhaseMap::order_error, false}}};

// Whether the layer holds its image: each coordinate goes to one of its two files.
bool HoldsImage(const Layer& layer, const PhaseMap& phase) {
  const Image<float>& image = phase.*layer.image;
  if (image.empty()) return false;
  if (&image == &phase.u) return phase.relative_u == (layer.relative != nullptr);
  if (&image == &phase.v) return phase.relative_v == (layer.relative != nullptr);
  return true;
}

constexpr const char* kTextureFile = "texture.png";
constexpr const char* kMaskFile = "mask.png";

template <typename T>
Status CheckSize(const Image<T>& image, const PhaseMap& phase, const std::string& name) {
  if (image.width() == phase.width && image.height() == phase.height) return {};
  return Fail("{}: is {} x {}, but the phase map is {} x {}", name, image.width(), image.height(),
              phase.width, phase.height);
}

Status CheckAxes(const PhaseMap& phase, const std::string& folder) {
  if (phase.u.empty() && phase.v.empty()) return Fail("{}: neither u nor v is coded", folder);
  const auto check_pair = [&](const char* axis, bool coordinate, bool sigma) -> Status {
    if (coordinate && !sigma) return Fail("{}: {} without sigma_{}", folder, axis, axis);
    if (sigma && !coordinate) return Fail("{}: sigma_{} without {}", folder, axis, axis);
    return {};
  };
  if (Status status = check_pair("u", !phase.u.empty(), !phase.sigma_u.empty()); !status) {
    return status;
  }
  return check_pair("v", !phase.v.empty(), !phase.sigma_v.empty());
}

Result<Image<std::uint8_t>> ReadMask(const std::string& path) {
  Result<FramePixels> pixels = ReadGrayImage(path);
  if (!pixels) return Forward(pixels);
  auto* mask = std::get_if<Image<std::uint8_t>>(&*pixels);
  if (mask == nullptr) return Fail("{}: must have 8 bit per pixel, has 16", path);
  for (const std::uint8_t reason : *mask) {
    if (reason >= kNumMaskReasons) {
      return Fail("{}: mask value {} is outside [0, {}]", path, reason, kNumMaskReasons - 1);
    }
  }
  return std::move(*mask);
}

Status ReadLayers(PhaseMap& phase, const fs::path& folder) {
  for (const Layer& layer : kLayers) {
    const std::string path = (folder / layer.file).string();
    std::error_code ignored;
    if (!layer.required && !fs::exists(path, ignored)) continue;
    Result<Image<float>> image = ReadFloatImage(path);
    if (!image) return tl::unexpected<Error>(image.error());
    if (Status status = CheckSize(*image, phase, path); !status) return status;
    phase.*layer.image = std::move(*image);
    if (layer.relative != nullptr) phase.*layer.relative = true;
  }
  // Pictures made by others may lack what only serves display.
  if (phase.offset.empty()) {
    phase.offset = Image<float>(phase.width, phase.height, std::numeric_limits<float>::quiet_NaN());
  }
  return CheckAxes(phase, folder.string());
}

Status ReadTexture(PhaseMap& phase, const std::string& path) {
  std::error_code ignored;
  if (!fs::exists(path, ignored)) {
    phase.color = Image<Rgb8>(phase.width, phase.height, Rgb8{180, 180, 180});
    return {};
  }
  Result<Image<Rgb8>> color = ReadColorImage(path);
  if (!color) return tl::unexpected<Error>(color.error());
  phase.color = std::move(*color);
  return CheckSize(phase.color, phase, path);
}

Status WriteLayers(const PhaseMap& phase, const std::string& owner, const fs::path& folder) {
  if (Status status = CheckAxes(phase, owner); !status) return status;
  if (Status status = CheckSize(phase.mask, phase, owner + ": mask"); !status) return status;
  for (const Layer& layer : kLayers) {
    const Image<float>& image = phase.*layer.image;
    if (!HoldsImage(layer, phase)) continue;
    if (Status status = CheckSize(image, phase, owner + ": " + layer.file); !status) return status;
    if (Status status = WriteImage(image, (folder / layer.file).string()); !status) return status;
  }
  if (!phase.color.empty()) {
    if (Status status = CheckSize(phase.color, phase, owner + ": color"); !status) return status;
    const std::string path = (folder / kTextureFile).string();
    if (Status status = WriteImage(phase.color, path); !status) return status;
  }
  return WriteImage(phase.mask, (folder / kMaskFile).string());
}

// Puts the finished layers in the place of earlier ones. Without its mask a map does not exist, so
// the mask goes first and comes last: no reader mixes layers of two maps.
Status MoveLayers(const fs::path& from, const fs::path& to) {
  std::error_code code;
  fs::remove(to / kMaskFile, code);
  std::vector<const char*> files;
  for (const Layer& layer : kLayers) files.push_back(layer.file);
  files.push_back(kTextureFile);
  files.push_back(kMaskFile);
  for (const char* file : files) {
    if (code) break;
    if (fs::exists(from / file, code)) {
      fs::rename(from / file, to / file, code);
    } else {
      fs::remove(to / file, code);  // an earlier map coded another axis
    }
  }
  if (code) return Fail("{}: cannot write the phase map: {}", to.string(), code.message());
  return {};
}

}  // namespace

Status WritePhaseMap(const ScanFolder& scan, int view_id, const PhaseMap& phase) {
  const fs::path folder = ViewFolder(scan, view_id);
  const fs::path unfinished = folder / ".phase.part";
  std::error_code ignored;
  fs::remove_all(unfinished, ignored);
  if (Status status = MakeFolder(unfinished.string()); !status) return status;
  Status status = WriteLayers(phase, folder.string(), unfinished);
  if (status) status = MoveLayers(unfinished, folder);
  fs::remove_all(unfinished, ignored);
  return status;
}

Result<PhaseMap> ReadPhaseMap(const ScanFolder& scan, int view_id) {
  const fs::path folder = ViewFolder(scan, view_id);
  const auto failed = [](const Status& status) { return tl::unexpected<Error>(status.error()); };
  PhaseMap phase;
  Result<Image<std::uint8_t>> mask = ReadMask((folder / kMaskFile).string());
  if (!mask) return Forward(mask);
  phase.mask = std::move(*mask);
  phase.width = phase.mask.width();
  phase.height = phase.mask.height();
  if (Status status = ReadLayers(phase, folder); !status) return failed(status);
  if (Status status = ReadTexture(phase, (folder / kTextureFile).string()); !status) {
    return failed(status);
  }
  const Result<ViewDescription> view = ReadViewDescription(scan, view_id);
  if (!view) return Forward(view);
  if (!view->stamps_ns.empty()) {
    phase.first_stamp_ns = view->stamps_ns.front();
    phase.last_stamp_ns = view->stamps_ns.back();
  }
  return phase;
}

}  // namespace fringe_fusion
