#include "step_fit.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace fringe_fusion::decode {
namespace {
constexpr double kTwoPi = 6.28318530717958647692;
}

StepFit::StepFit(const PhaseSet& set, int width) : set_(set) {
  const std::size_t num_steps = set.frame_of_step.size();
  for (std::size_t n = 0; n < num_steps; ++n) {
    const double delta = kTwoPi * static_cast<double>(n) / static_cast<double>(num_steps);
    cos_.push_back(static_cast<float>(std::cos(delta)));
    sin_.push_back(static_cast<float>(std::sin(delta)));
  }
  for (std::vector<float>* row :
       {&offset_, &cosine_part_, &sine_part_, &phase_, &modulation_, &residual_, &peak_}) {
    row->resize(static_cast<std::size_t>(width));
  }
}

void StepFit::Run(const FrameRows& rows) {
  Accumulate(rows);
  for (std::size_t x = 0; x < phase_.size(); ++x) {
    modulation_[x] = std::sqrt(cosine_part_[x] * cosine_part_[x] + sine_part_[x] * sine_part_[x]);
    phase_[x] = std::atan2(sine_part_[x], cosine_part_[x]);
  }
  SumResiduals(rows);
}

// A = sum I / N, (a, b) = 2/N (sum I cos, sum I sin), so that I = A + a cos + b sin.
void StepFit::Accumulate(const FrameRows& rows) {
  const std::size_t width = phase_.size();
  for (std::vector<float>* row : {&offset_, &cosine_part_, &sine_part_, &peak_}) {
    std::fill(row->begin(), row->end(), 0.0F);
  }
  const float share = 1.0F / num_steps();
  for (std::size_t n = 0; n < cos_.size(); ++n) {
    const float* in = rows.frame(set_.frame_of_step[n]);
    const float c = 2.0F * share * cos_[n];
    const float s = 2.0F * share * sin_[n];
    for (std::size_t x = 0; x < width; ++x) {
      offset_[x] += share * in[x];
      cosine_part_[x] += c * in[x];
      sine_part_[x] += s * in[x];
      peak_[x] = peak_[x] > in[x] ? peak_[x] : in[x];
    }
  }
}

// By differences, not by sum I^2 - N A^2 - N B^2 / 2: that cancels badly at 12 and 16 bit.
void StepFit::SumResiduals(const FrameRows& rows) {
  std::fill(residual_.begin(), residual_.end(), 0.0F);
  if (cos_.size() < 4) return;
  for (std::size_t n = 0; n < cos_.size(); ++n) {
    const float* in = rows.frame(set_.frame_of_step[n]);
    const float c = cos_[n];
    const float s = sin_[n];
    for (std::size_t x = 0; x < residual_.size(); ++x) {
      const float r = in[x] - offset_[x] - c * cosine_part_[x] - s * sine_part_[x];
      residual_[x] += r * r;
    }
  }
}

}  // namespace fringe_fusion::decode
