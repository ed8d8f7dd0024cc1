#include "fringe_program.hpp"

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <fstream>
#include <sstream>

#include "fringe_fusion/io/scan_folder.hpp"
#include "fringe_fusion/sim/sim_cell.hpp"

namespace fringe_fusion::cli {

namespace fs = std::filesystem;

namespace {

void RedirectTo(const fs::path& file, int descriptor) {
  const int opened = open(file.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  dup2(opened, descriptor);
}

/// Blocked and pending signals stay so across exec.
void LeavePending(int signal_number) {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, signal_number);
  sigprocmask(SIG_BLOCK, &signals, nullptr);
  raise(signal_number);
}

CameraModel Scaled(const CameraModel& model, double factor) {
  CameraModel scaled = model;
  scaled.width = static_cast<int>(model.width * factor);
  scaled.height = static_cast<int>(model.height * factor);
  scaled.fx = model.fx * factor;
  scaled.fy = model.fy * factor;
  scaled.cx = (model.cx + 0.5) * factor - 0.5;
  scaled.cy = (model.cy + 0.5) * factor - 0.5;
  return scaled;
}

}  // namespace

Outcome RunFringe(const std::vector<std::string>& arguments, int pending_signal) {
  const TemporaryFolder folder("fringe_output");
  std::vector<std::string> words{FRINGE_PROGRAM};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::vector<char*> argv;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  const pid_t child = fork();
  if (child == 0) {
    RedirectTo(folder / "out", STDOUT_FILENO);
    RedirectTo(folder / "err", STDERR_FILENO);
    if (pending_signal != 0) LeavePending(pending_signal);
    execv(argv[0], argv.data());
    _exit(127);
  }
  int status = 0;
  waitpid(child, &status, 0);
  Outcome outcome;
  outcome.exit_status = WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
  outcome.out = ReadBytes(folder / "out");
  outcome.err = ReadBytes(folder / "err");
  return outcome;
}

std::string ReadBytes(const fs::path& path) {
  std::ifstream stream(path, std::ios::binary);
  EXPECT_TRUE(stream.good()) << path;
  std::ostringstream bytes;
  bytes << stream.rdbuf();
  return bytes.str();
}

void WriteBytes(const fs::path& path, const std::string& bytes) {
  fs::create_directories(path.parent_path());
  std::ofstream stream(path, std::ios::binary);
  stream << bytes;
  stream.close();
  ASSERT_TRUE(stream.good()) << path;
}

void ReplaceInFile(const fs::path& path, const std::string& from, const std::string& to) {
  std::string text = ReadBytes(path);
  const std::size_t at = text.find(from);
  ASSERT_NE(at, std::string::npos) << path << " does not contain " << from;
  WriteBytes(path, text.replace(at, from.size(), to));
}

void RemovePrior(const fs::path& view_yaml) {
  std::string text = ReadBytes(view_yaml);
  const std::size_t begin = text.find("prior:");
  const std::string last = "  source: file\n";
  const std::size_t end = text.find(last, begin);
  ASSERT_NE(begin, std::string::npos) << view_yaml;
  ASSERT_NE(end, std::string::npos) << view_yaml;
  WriteBytes(view_yaml, text.erase(begin, end + last.size() - begin));
}

std::vector<std::string> ListFiles(const fs::path& folder) {
  std::vector<std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) files.push_back(entry.path().lexically_relative(folder).string());
  }
  std::sort(files.begin(), files.end());
  return files;
}

TemporaryFolder::TemporaryFolder(const std::string& name) {
  std::string pattern = (fs::temp_directory_path() / (name + ".XXXXXX")).string();
  EXPECT_NE(mkdtemp(pattern.data()), nullptr) << pattern;
  path_ = pattern;
}

TemporaryFolder::~TemporaryFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

void WriteSmallCellConfig(const fs::path& folder) {
  fs::create_directories(folder);
  CellCalibration calibration = sim::DefaultCalibration();
  calibration.camera = Scaled(calibration.camera, 0.2);
  calibration.projector = Scaled(calibration.projector, 0.25);
  const Status status = WriteCellCalibration(calibration, (folder / "cell.yaml").string());
  ASSERT_TRUE(status) << status.error().message;
  fs::copy_file(SOURCE_DIR "/config/sim.yaml", folder / "sim.yaml");
  fs::copy_file(SOURCE_DIR "/config/simulate_scan.yaml", folder / "simulate_scan.yaml");
  ReplaceInFile(folder / "simulate_scan.yaml", "plate_radius_m: 0.07", "plate_radius_m: 0.0");
  ReplaceInFile(folder / "sim.yaml", "projector_gamma: 1.0", "projector_gamma: 1.2");
  ReplaceInFile(folder / "sim.yaml", "gain_dn: 0.0", "gain_dn: 0.02");
  ReplaceInFile(folder / "sim.yaml", "read_noise_dn: 0.0", "read_noise_dn: 0.5");
  ReplaceInFile(folder / "sim.yaml", "ambient_ratio: 0.0", "ambient_ratio: 0.05");
  ReplaceInFile(folder / "sim.yaml", "turntable_angle_sigma_deg: 0.0",
                "turntable_angle_sigma_deg: 0.05");
  ReplaceInFile(folder / "sim.yaml", "turntable_shift_sigma_mm: 0.0",
                "turntable_shift_sigma_mm: 0.1");
  // The part stands on a plate, which is not part of it.
  fs::copy_file(SOURCE_DIR "/config/crop.yaml", folder / "crop.yaml");
  ReplaceInFile(folder / "crop.yaml", "remove_plane: false", "remove_plane: true");
}

}  // namespace fringe_fusion::cli
