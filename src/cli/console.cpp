#include "console.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace fringe_fusion::cli {
namespace {

constexpr int kBarWidth = 30;
constexpr auto kRedrawInterval = std::chrono::milliseconds(100);

sigset_t InterruptSignals() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  return signals;
}

}  // namespace

InterruptGuard::InterruptGuard() {
  const sigset_t signals = InterruptSignals();
  pthread_sigmask(SIG_BLOCK, &signals, &previous_);
}

InterruptGuard::~InterruptGuard() {
  // A signal that was answered by a clean end must not kill the process when it is let through.
  const sigset_t signals = InterruptSignals();
  const timespec no_wait{0, 0};
  while (sigtimedwait(&signals, nullptr, &no_wait) > 0) {
  }
  pthread_sigmask(SIG_SETMASK, &previous_, nullptr);
}

bool InterruptGuard::Pending() {
  sigset_t pending;
  sigemptyset(&pending);
  sigpending(&pending);
  return sigismember(&pending, SIGINT) == 1 || sigismember(&pending, SIGTERM) == 1;
}

Console::Console(std::string command, bool quiet)
    : command_(std::move(command)), quiet_(quiet), terminal_(isatty(STDERR_FILENO) == 1) {}

void Console::Begin(const std::string& step, int num_parts) {
  step_ = step;
  num_parts_ = std::max(1, num_parts);
  begin_ = std::chrono::steady_clock::now();
  drawn_ = {};
  Draw(0.0);
}

Progress Console::Part(int part) {
  return [this, part](const std::string& /*stage*/, double fraction) {
    const double within = std::isfinite(fraction) ? std::clamp(fraction, 0.0, 1.0) : 0.0;
    Draw((part + within) / num_parts_);
    return !InterruptGuard::Pending();
  };
}

void Console::End() {
  const std::chrono::duration<double> elapsed = std::chrono::steady_clock::now() - begin_;
  seconds_.emplace_back(step_, elapsed.count());
  if (quiet_) return;
  if (terminal_) fmt::print(stderr, "\r\033[K");
  fmt::print(stderr, "fringe {}: {} {:.2f} s\n", command_, step_, elapsed.count());
}

void Console::Draw(double fraction) {
  if (quiet_ || !terminal_) return;
  const auto now = std::chrono::steady_clock::now();
  if (now - drawn_ < kRedrawInterval) return;
  drawn_ = now;
  const int filled = std::clamp(static_cast<int>(fraction * kBarWidth), 0, kBarWidth);
  fmt::print(stderr, "\rfringe {}: {:<12} [{:#<{}}{: <{}}] {:3.0f} %", command_, step_, "", filled,
             "", kBarWidth - filled, 100.0 * fraction);
  std::fflush(stderr);
}

}  // namespace fringe_fusion::cli
