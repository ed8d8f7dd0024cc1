#include "fringe_fusion/io/scan_folder.hpp"

#include <algorithm>
#include <cstdlib>
#include <filesystem>

#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/io/calibration_files.hpp"
#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/image_io.hpp"

namespace fringe_fusion {
namespace {

namespace fs = std::filesystem;

std::string CellPath(const std::string& scan) { return (fs::path(scan) / "cell.yaml").string(); }

std::string PatternsPath(const std::string& scan) {
  return (fs::path(scan) / "patterns.yaml").string();
}

std::string ViewYamlPath(const ScanFolder& scan, int view_id) {
  return (fs::path(ViewFolder(scan, view_id)) / "view.yaml").string();
}

std::string ViewName(int view_id) { return fmt::format("{:03d}", view_id); }

bool IsNumber(const std::string& name) {
  return !name.empty() && name.size() <= 9 &&
         std::all_of(name.begin(), name.end(), [](char c) { return c >= '0' && c <= '9'; });
}

Result<std::vector<int>> FindViews(const fs::path& views) {
  std::vector<int> ids;
  std::error_code code;
  if (!fs::exists(views, code)) return ids;
  for (fs::directory_iterator it(views, code), end; !code && it != end; it.increment(code)) {
    const std::string name = it->path().filename().string();
    if (!IsNumber(name)) continue;
    if (!fs::exists(it->path() / "view.yaml")) {
      return Fail("{}: has no view.yaml: complete the view, or remove its folder",
                  it->path().string());
    }
    const int id = std::stoi(name);
    if (ViewName(id) != name) {
      return Fail("{}: the folder of view {} must be named {}", it->path().string(), id,
                  ViewName(id));
    }
    ids.push_back(id);
  }
  if (code) return Fail("{}: cannot be listed: {}", views.string(), code.message());
  std::sort(ids.begin(), ids.end());
  return ids;
}

// Runs `work(i)` for i in [0, count) on all threads; the failure of the lowest i wins.
Status ForEachFile(std::size_t count, const std::function<Status(std::size_t)>& work) {
  std::vector<Status> statuses(count);
  ParallelFor(static_cast<int>(count), 1, [&](int begin, int end) {
    for (int i = begin; i < end; ++i) {
      statuses[static_cast<std::size_t>(i)] = work(static_cast<std::size_t>(i));
    }
  });
  for (const Status& status : statuses) {
    if (!status) return status;
  }
  return {};
}

template <typename T>
Status CheckCount(const char* key, const std::vector<T>& values, const ScanFolder& scan,
                  const std::string& path) {
  const std::size_t expected = scan.sequence.frames.size();
  if (values.empty() || values.size() == expected) return {};
  return Fail("{}: {} has {} entries, but patterns.yaml has {} frames", path, key, values.size(),
              expected);
}

// A 12-bit value in the upper bits of a 16-bit file would silently change saturation and noise.
Status CheckFullScale(const CapturedFrame& frame, const std::string& path) {
  const int full_scale = (1 << frame.bit_depth) - 1;
  int largest = 0;
  std::visit(
      [&](const auto& image) {
        for (const auto value : image) largest = std::max(largest, static_cast<int>(value));
      },
      frame.pixels);
  if (largest <= full_scale) return {};
  return Fail("{}: grey value {} exceeds {}, the full scale of {} bit", path, largest, full_scale,
              frame.bit_depth);
}

Result<CapturedFrame> ReadFrame(const ScanFolder& scan, const ViewDescription& view, std::size_t i,
                                const std::string& path) {
  Result<FramePixels> pixels = ReadGrayImage(path);
  if (!pixels) return Forward(pixels);
  CapturedFrame frame;
  frame.pixels = std::move(*pixels);
  const int file_bits = frame.pixels.index() == 0 ? 8 : 16;
  frame.bit_depth = view.bit_depth == 0 ? file_bits : view.bit_depth;
  if (!view.stamps_ns.empty()) frame.stamp_ns = view.stamps_ns[i];
  if (!view.exposures_s.empty()) frame.exposure_s = view.exposures_s[i];
  if (!view.gains.empty()) frame.gain = view.gains[i];
  const CameraModel& camera = scan.calibration.camera;
  if (Width(frame) != camera.width || Height(frame) != camera.height) {
    return Fail("{}: the image is {} x {}, but the camera of cell.yaml has {} x {}", path,
                Width(frame), Height(frame), camera.width, camera.height);
  }
  if (frame.bit_depth > file_bits) {
    return Fail("{}: bit_depth is {}, but the file has {} bit", path, frame.bit_depth, file_bits);
  }
  if (Status status = CheckFullScale(frame, path); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return frame;
}

ViewDescription Describe(const ImageStack& stack, const std::optional<Pose>& prior,
                         const std::vector<double>& joint_positions) {
  ViewDescription view;
  view.scan_id = stack.scan_id;
  view.camera_id = stack.camera_id;
  view.bit_depth = stack.frames.front().bit_depth;
  view.prior = prior;
  view.joint_positions = joint_positions;
  bool unit_gain = true;
  for (std::size_t i = 0; i < stack.frames.size(); ++i) {
    view.frame_files.push_back(fmt::format("frame_{:03d}.png", i));
    view.stamps_ns.push_back(stack.frames[i].stamp_ns);
    view.exposures_s.push_back(stack.frames[i].exposure_s);
    view.gains.push_back(stack.frames[i].gain);
    unit_gain = unit_gain && stack.frames[i].gain == 1.0;
  }
  if (unit_gain) view.gains.clear();
  if (stack.color) view.color_file = "color.png";
  return view;
}

Status WriteViewFiles(const ImageStack& stack, const ViewDescription& view,
                      const fs::path& folder) {
  if (Status status = MakeFolder(folder.string()); !status) return status;
  const auto write = [&](std::size_t i) {
    return WriteImage(stack.frames[i].pixels, (folder / view.frame_files[i]).string());
  };
  if (Status status = ForEachFile(stack.frames.size(), write); !status) return status;
  if (stack.color) {
    if (Status status = WriteImage(*stack.color, (folder / view.color_file).string()); !status) {
      return status;
    }
  }
  return WriteViewDescriptionFile(view, (folder / "view.yaml").string());
}

// Puts a finished folder in the place of an earlier one.
Status ReplaceFolder(const fs::path& finished, const fs::path& target) {
  const fs::path earlier = target.parent_path() / ("." + target.filename().string() + ".old");
  std::error_code code;
  fs::remove_all(earlier, code);
  if (fs::exists(target, code)) fs::rename(target, earlier, code);
  if (!code) fs::rename(finished, target, code);
  if (code) {
    std::error_code ignored;
    if (!fs::exists(target, ignored)) fs::rename(earlier, target, ignored);
    return Fail("{}: cannot be replaced: {}", target.string(), code.message());
  }
  fs::remove_all(earlier, code);
  return {};
}

bool SamePatterns(const PatternSequence& a, const PatternSequence& b) {
  const auto same = [](const Pattern& p, const Pattern& q) {
    return PatternName(p) == PatternName(q) && p.fringes == q.fringes && p.cell_px == q.cell_px &&
           p.offset_px == q.offset_px && p.phase_sign == q.phase_sign &&
           p.phase_offset_rad == q.phase_offset_rad && p.exposure_ratio == q.exposure_ratio &&
           p.carrier_period_px == q.carrier_period_px;
  };
  return a.width == b.width && a.height == b.height &&
         std::equal(a.frames.begin(), a.frames.end(), b.frames.begin(), b.frames.end(), same);
}

// Views that exist belong to the calibration and patterns beside them.
Status CheckSameScan(const std::string& path, const CellCalibration& calibration,
                     const PatternSequence& sequence) {
  const Result<std::vector<int>> views = FindViews(fs::path(path) / "views");
  if (!views) return tl::unexpected<Error>(views.error());
  if (views->empty()) return {};
  const Result<ScanFolder> earlier = OpenScan(path);
  if (!earlier) return tl::unexpected<Error>(earlier.error());
  const std::string earlier_id = CalibrationId(earlier->calibration);
  if (earlier_id != CalibrationId(calibration)) {
    return Fail("{}: has {} views taken with calibration {}, not {}", path, views->size(),
                earlier_id, CalibrationId(calibration));
  }
  if (!SamePatterns(earlier->sequence, sequence)) {
    return Fail("{}: has {} views taken with other patterns", path, views->size());
  }
  return {};
}

}  // namespace

std::string ViewFolder(const ScanFolder& scan, int view_id) {
  return (fs::path(scan.path) / "views" / ViewName(view_id)).string();
}

Result<ScanFolder> OpenScan(const std::string& path) {
  std::error_code code;
  if (!fs::is_directory(path, code)) return Fail("{}: no such scan folder", path);
  ScanFolder scan;
  scan.path = path;
  Result<CellCalibration> calibration = ReadCellCalibration(CellPath(path));
  if (!calibration) return Forward(calibration);
  Result<PatternSequence> sequence = ReadPatterns(PatternsPath(path));
  if (!sequence) return Forward(sequence);
  const CameraModel& projector = calibration->projector;
  if (sequence->width != projector.width || sequence->height != projector.height) {
    return Fail("{}: projector size {} x {} differs from {} x {} of cell.yaml", PatternsPath(path),
                sequence->width, sequence->height, projector.width, projector.height);
  }
  Result<std::vector<int>> view_ids = FindViews(fs::path(path) / "views");
  if (!view_ids) return Forward(view_ids);
  scan.calibration = std::move(*calibration);
  scan.sequence = std::move(*sequence);
  scan.view_ids = std::move(*view_ids);
  return scan;
}

Result<ScanFolder> OpenUncalibratedScan(const std::string& path) {
  std::error_code code;
  if (!fs::is_directory(path, code)) return Fail("{}: no such scan folder", path);
  ScanFolder scan;
  scan.path = path;
  Result<PatternSequence> sequence = ReadPatterns(PatternsPath(path));
  if (!sequence) return Forward(sequence);
  Result<std::vector<int>> view_ids = FindViews(fs::path(path) / "views");
  if (!view_ids) return Forward(view_ids);
  if (view_ids->empty()) return Fail("{}: has no views", path);
  scan.sequence = std::move(*sequence);
  scan.view_ids = std::move(*view_ids);
  const int first = scan.view_ids.front();
  const Result<ViewDescription> view = ReadViewDescription(scan, first);
  if (!view) return Forward(view);
  const fs::path frame = fs::path(FrameFolder(scan, first, *view)) / view->frame_files.front();
  const Result<FramePixels> pixels = ReadGrayImage(frame.string());
  if (!pixels) return Forward(pixels);
  CapturedFrame captured;
  captured.pixels = *pixels;
  CameraModel& camera = scan.calibration.camera;
  camera.width = Width(captured);
  camera.height = Height(captured);
  scan.calibration.projector.width = scan.sequence.width;
  scan.calibration.projector.height = scan.sequence.height;
  return scan;
}

Result<ScanFolder> CreateScan(const std::string& path, const CellCalibration& calibration,
                              const PatternSequence& sequence) {
  const auto failed = [](const Status& status) { return tl::unexpected<Error>(status.error()); };
  if (Status status = CheckSameScan(path, calibration, sequence); !status) return failed(status);
  if (Status status = MakeFolder((fs::path(path) / "views").string()); !status) {
    return failed(status);
  }
  if (Status status = WriteCellCalibration(calibration, CellPath(path)); !status) {
    return failed(status);
  }
  if (Status status = WritePatterns(sequence, PatternsPath(path)); !status) return failed(status);
  return OpenScan(path);
}

std::string FrameFolder(const ScanFolder& scan, int view_id, const ViewDescription& view) {
  const fs::path own = ViewFolder(scan, view_id);
  if (view.root.empty()) return own.string();
  const std::string shared = "shared/data/";
  const char* data = std::getenv("FRINGE_FUSION_DATA");
  const std::size_t at = view.root.find(shared);
  if (data != nullptr && *data != '\0' && at != std::string::npos) {
    return (fs::path(data) / view.root.substr(at + shared.size())).lexically_normal().string();
  }
  return (own / view.root).lexically_normal().string();
}

Result<ViewDescription> ReadViewDescription(const ScanFolder& scan, int view_id) {
  const std::string path = ViewYamlPath(scan, view_id);
  Result<ViewDescription> view = ReadViewDescriptionFile(path);
  if (!view) return view;
  if (view->frame_files.empty()) {
    for (std::size_t i = 0; i < scan.sequence.frames.size(); ++i) {
      view->frame_files.push_back(fmt::format("frame_{:03d}.png", i));
    }
  }
  for (const Status& status : {CheckCount("frames", view->frame_files, scan, path),
                               CheckCount("stamps_ns", view->stamps_ns, scan, path),
                               CheckCount("exposures_s", view->exposures_s, scan, path),
                               CheckCount("gains", view->gains, scan, path)}) {
    if (!status) return tl::unexpected<Error>(status.error());
  }
  return view;
}

Result<ImageStack> ReadStack(const ScanFolder& scan, int view_id) {
  const Result<ViewDescription> view = ReadViewDescription(scan, view_id);
  if (!view) return Forward(view);
  const std::string& serial = scan.calibration.camera_serial;
  if (!view->camera_id.empty() && !serial.empty() && view->camera_id != serial) {
    return Fail("{}: camera_id '{}' is not the camera '{}' that {} calibrates (camera_serial)",
                ViewYamlPath(scan, view_id), view->camera_id, serial, CellPath(scan.path));
  }
  const fs::path folder = FrameFolder(scan, view_id, *view);
  ImageStack stack;
  stack.scan_id = view->scan_id;
  stack.view_id = view_id;
  stack.camera_id = view->camera_id;
  stack.sequence = scan.sequence;
  stack.frames.resize(view->frame_files.size());
  const auto read = [&](std::size_t i) -> Status {
    Result<CapturedFrame> frame =
        ReadFrame(scan, *view, i, (folder / view->frame_files[i]).string());
    if (!frame) return Forward(frame);
    stack.frames[i] = std::move(*frame);
    return {};
  };
  if (Status status = ForEachFile(stack.frames.size(), read); !status) {
    return tl::unexpected<Error>(status.error());
  }
  if (!view->color_file.empty()) {
    Result<Image<Rgb8>> color = ReadColorImage((folder / view->color_file).string());
    if (!color) return Forward(color);
    stack.color = std::move(*color);
  }
  if (Status status = Validate(stack, ViewFolder(scan, view_id)); !status) {
    return tl::unexpected<Error>(status.error());
  }
  return stack;
}

Status WriteStack(const ScanFolder& scan, const ImageStack& stack, const std::optional<Pose>& prior,
                  const std::vector<double>& joint_positions) {
  const fs::path folder = ViewFolder(scan, stack.view_id);
  if (stack.view_id < 0) return Fail("{}: view id must be at least 0", folder.string());
  if (Status status = Validate(stack, folder.string()); !status) return status;
  if (!SamePatterns(stack.sequence, scan.sequence)) {
    return Fail("{}: the stack has other patterns than patterns.yaml", folder.string());
  }
  const CameraModel& camera = scan.calibration.camera;
  if (Width(stack.frames[0]) != camera.width || Height(stack.frames[0]) != camera.height) {
    return Fail("{}: the frames are {} x {}, but the camera of cell.yaml has {} x {}",
                folder.string(), Width(stack.frames[0]), Height(stack.frames[0]), camera.width,
                camera.height);
  }
  const fs::path unfinished = folder.parent_path() / ("." + ViewName(stack.view_id) + ".part");
  std::error_code ignored;
  fs::remove_all(unfinished, ignored);
  Status status = WriteViewFiles(stack, Describe(stack, prior, joint_positions), unfinished);
  if (status) status = ReplaceFolder(unfinished, folder);
  if (!status) fs::remove_all(unfinished, ignored);
  return status;
}

}  // namespace fringe_fusion
