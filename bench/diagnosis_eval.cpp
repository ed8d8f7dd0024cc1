// Judges the self-diagnosis on simulated stacks: one fault at a time in three strengths, and stacks
// without a fault. "tuning" uses scenes for choosing limits, "evaluation" those fixed beforehand.
//
//   diagnosis_eval tuning|evaluation [--faults N] [--clean N] [--only FAULT] [--values FILE.csv]

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <map>
#include <string>
#include <vector>

#include "bench/diagnosis_scenes.hpp"
#include "fringe_fusion/common/parallel.hpp"
#include "fringe_fusion/diagnosis/diagnose_stack.hpp"

namespace fringe_fusion::bench {
namespace {

constexpr int kNumThreads = 2;
constexpr int kFirstCleanTuningScene = 1000;  // tuning scenes with and without fault differ

struct Options {
  bool evaluation = false;
  int num_fault_scenes = kNumFaultScenes;
  int num_clean_scenes = kNumCleanScenes;
  std::string only;
  std::string values_file;
};

struct Case {
  Fault fault = Fault::kNone;
  int strength = 0;
  int scene = 0;
  int seed = 0;
};

struct Outcome {
  std::string first;  ///< name of the first finding, "none", or "error"
  std::string all;
  Diagnosis diagnosis;
};

// Name that the diagnosis should give first.
std::string Expected(Fault fault) {
  constexpr std::array<FindingKind, kNumFaults> kKinds{
      FindingKind::kResponse,      FindingKind::kResponse,         FindingKind::kFramesShifted,
      FindingKind::kFramesDropped, FindingKind::kFramesDuplicated, FindingKind::kFramesSwapped,
      FindingKind::kExposure,      FindingKind::kSaturation,       FindingKind::kTooLittleLight,
      FindingKind::kMotion,        FindingKind::kProjectorDefocus, FindingKind::kCameraDefocus,
      FindingKind::kFlicker,       FindingKind::kInterreflection,  FindingKind::kResolution};
  return fault == Fault::kNone ? "none" : FindingName(kKinds[static_cast<std::size_t>(fault)]);
}

bool IsWanted(const Options& options, Fault fault) {
  return options.only.empty() || options.only == Expected(fault);
}

// Scene by scene, so that a run that is cut short has judged all faults alike.
std::vector<Case> MakeCases(const Options& options) {
  std::vector<Case> cases;
  for (int scene = 0; scene < options.num_fault_scenes; ++scene) {
    for (int f = 1; f < kNumFaults; ++f) {
      const auto fault = static_cast<Fault>(f);
      if (!IsWanted(options, fault)) continue;
      const int seed = options.evaluation ? FaultSeed(scene) : TuningSeed(scene);
      for (int s = 0; s < kNumStrengths; ++s) cases.push_back({fault, s, scene, seed});
    }
  }
  for (int scene = 0; scene < options.num_clean_scenes; ++scene) {
    if (!IsWanted(options, Fault::kNone)) continue;
    const int seed =
        options.evaluation ? CleanSeed(scene) : TuningSeed(kFirstCleanTuningScene + scene);
    cases.push_back({Fault::kNone, 0, scene, seed});
  }
  return cases;
}

Outcome Judge(const Case& item) {
  const DiagnosisScene scene = MakeDiagnosisScene(item.seed, item.fault);
  const ImageStack stack = CaptureWithFault(scene, item.fault, item.strength);
  Outcome outcome;
  Result<Diagnosis> diagnosis = DiagnoseStack(stack, {}, {}, scene.calibration);
  if (!diagnosis) {
    outcome.first = "error";
    outcome.all = diagnosis.error().message;
    return outcome;
  }
  outcome.diagnosis = std::move(*diagnosis);
  outcome.first = "none";
  for (const Finding& finding : outcome.diagnosis.findings) {
    if (outcome.all.empty()) outcome.first = FindingName(finding.kind);
    outcome.all += fmt::format("{}{} {:.4g}", outcome.all.empty() ? "" : ", ",
                               FindingName(finding.kind), finding.value);
  }
  return outcome;
}

std::vector<Outcome> JudgeAll(const std::vector<Case>& cases) {
  constexpr int kBatch = 24;
  const ThreadLimit threads(kNumThreads);
  std::vector<Outcome> outcomes(cases.size());
  const auto count = static_cast<int>(cases.size());
  for (int first = 0; first < count; first += kBatch) {
    ParallelFor(std::min(kBatch, count - first), 1, [&](int begin, int end) {
      for (auto i = static_cast<std::size_t>(first + begin);
           i < static_cast<std::size_t>(first + end); ++i) {
        outcomes[i] = Judge(cases[i]);
      }
    });
    const int done = std::min(first + kBatch, count);
    int correct = 0;
    for (int i = 0; i < done; ++i) {
      const auto k = static_cast<std::size_t>(i);
      if (outcomes[k].first == Expected(cases[k].fault)) ++correct;
    }
    fmt::print(stderr, "{} of {} judged, {} correct\n", done, count, correct);
  }
  return outcomes;
}

void PrintConfusion(const std::vector<Case>& cases, const std::vector<Outcome>& outcomes) {
  std::map<std::string, std::map<std::string, int>> table;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    ++table[Expected(cases[i].fault)][outcomes[i].first];
  }
  fmt::print("\nfault injected -> name that came first (count)\n");
  for (const auto& [expected, row] : table) {
    fmt::print("  {:18}", expected);
    for (const auto& [name, count] : row) fmt::print("  {} {}", name, count);
    fmt::print("\n");
  }
}

void PrintRates(const std::vector<Case>& cases, const std::vector<Outcome>& outcomes) {
  std::map<std::pair<std::string, int>, std::pair<int, int>> rates;
  std::pair<int, int> faults;
  std::pair<int, int> clean;
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const std::string expected = Expected(cases[i].fault);
    const int correct = outcomes[i].first == expected ? 1 : 0;
    auto& sum = cases[i].fault == Fault::kNone ? clean : faults;
    auto& cell = rates[{expected, cases[i].strength}];
    for (auto* pair : {&sum, &cell}) {
      pair->first += correct;
      ++pair->second;
    }
  }
  fmt::print("\ncorrect name first, by fault and strength\n");
  for (const auto& [key, pair] : rates) {
    fmt::print("  {:18} {}  {}/{}\n", key.first, key.second + 1, pair.first, pair.second);
  }
  const auto percent = [](std::pair<int, int> pair) {
    return pair.second > 0 ? 100.0 * pair.first / pair.second : 0.0;
  };
  fmt::print("faults: {}/{} = {:.2f} % (goal 95 %)\n", faults.first, faults.second,
             percent(faults));
  fmt::print("clean: {}/{} = {:.2f} % without a finding (goal 99 %)\n", clean.first, clean.second,
             percent(clean));
}

void PrintMisses(const std::vector<Case>& cases, const std::vector<Outcome>& outcomes) {
  fmt::print("\nmisses\n");
  for (std::size_t i = 0; i < cases.size(); ++i) {
    if (outcomes[i].first == Expected(cases[i].fault)) continue;
    fmt::print("  {} {} scene {} (seed {}): {}\n", Expected(cases[i].fault), cases[i].strength + 1,
               cases[i].scene, cases[i].seed,
               outcomes[i].all.empty() ? "no finding" : outcomes[i].all);
  }
}

void WriteValues(const std::string& file, const std::vector<Case>& cases,
                 const std::vector<Outcome>& outcomes) {
  std::ofstream out(file);
  out << "fault,strength,seed,first,kind,value,limit,state\n";
  for (std::size_t i = 0; i < cases.size(); ++i) {
    for (const Check& check : outcomes[i].diagnosis.checks) {
      out << fmt::format("{},{},{},{},{},{},{},{}\n", Expected(cases[i].fault),
                         cases[i].strength + 1, cases[i].seed, outcomes[i].first,
                         FindingName(check.kind), check.value, check.limit,
                         CheckStateName(check.state));
    }
  }
}

bool ReadOptions(const std::vector<std::string>& arguments, Options& options) {
  if (arguments.empty()) return false;
  options.evaluation = arguments.front() == "evaluation";
  if (!options.evaluation && arguments.front() != "tuning") return false;
  for (std::size_t i = 1; i + 1 < arguments.size(); i += 2) {
    const std::string& value = arguments[i + 1];
    if (arguments[i] == "--faults") {
      options.num_fault_scenes = std::atoi(value.c_str());
    } else if (arguments[i] == "--clean") {
      options.num_clean_scenes = std::atoi(value.c_str());
    } else if (arguments[i] == "--only") {
      options.only = value;
    } else if (arguments[i] == "--values") {
      options.values_file = value;
    } else {
      return false;
    }
  }
  return arguments.size() % 2 == 1;
}

}  // namespace
}  // namespace fringe_fusion::bench

int main(int argc, char** argv) {
  using namespace fringe_fusion::bench;
  Options options;
  if (!ReadOptions({argv + 1, argv + argc}, options)) {
    fmt::print(stderr,
               "usage: diagnosis_eval tuning|evaluation [--faults N] [--clean N] [--only FAULT] "
               "[--values FILE.csv]\n");
    return EXIT_FAILURE;
  }
  const std::vector<Case> cases = MakeCases(options);
  const std::vector<Outcome> outcomes = JudgeAll(cases);
  PrintConfusion(cases, outcomes);
  PrintRates(cases, outcomes);
  PrintMisses(cases, outcomes);
  if (!options.values_file.empty()) WriteValues(options.values_file, cases, outcomes);
  return EXIT_SUCCESS;
}
