#include "fringe_fusion/common/parallel.hpp"

#include <tbb/global_control.h>
#include <tbb/info.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstddef>
#include <stdexcept>

namespace fringe_fusion {

struct ThreadLimit::Impl {
  explicit Impl(int num_threads)
      : control(tbb::global_control::max_allowed_parallelism,
                static_cast<std::size_t>(num_threads)) {}
  tbb::global_control control;
};

ThreadLimit::ThreadLimit(int num_threads) {
  if (num_threads < 0) throw std::invalid_argument("ThreadLimit: negative number of threads");
  impl_ = std::make_unique<Impl>(num_threads > 0 ? num_threads : tbb::info::default_concurrency());
}
ThreadLimit::~ThreadLimit() = default;

void ParallelFor(int count, int grain, const std::function<void(int, int)>& body) {
  if (grain < 1) throw std::invalid_argument("ParallelFor: grain must be at least 1");
  if (count <= 0) return;
  const int num_chunks = (count - 1) / grain + 1;
  tbb::parallel_for(0, num_chunks, [&](int chunk) {
    const int begin = chunk * grain;
    body(begin, std::min(count - begin, grain) + begin);
  });
}

}  // namespace fringe_fusion
