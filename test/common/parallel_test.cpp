#include "fringe_fusion/common/parallel.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <stdexcept>
#include <vector>

namespace fringe_fusion {
namespace {

// A sum whose rounding depends on the order: only fixed chunks give the same bits.
double SumInChunks(int num_threads) {
  const ThreadLimit limit(num_threads);
  constexpr int kCount = 100003;
  constexpr int kGrain = 97;
  std::vector<double> partial((kCount - 1) / kGrain + 1, 0.0);
  ParallelFor(kCount, kGrain, [&](int begin, int end) {
    double sum = 0.0;
    for (int i = begin; i < end; ++i) sum += std::sin(i) * 1e-3 * i;
    partial[static_cast<std::size_t>(begin / kGrain)] = sum;
  });
  return std::accumulate(partial.begin(), partial.end(), 0.0);
}

TEST(ParallelFor, CoversEveryIndexOnce) {
  for (const int count : {0, 1, 7, 8, 9, 1000}) {
    std::vector<int> visits(static_cast<std::size_t>(count), 0);
    ParallelFor(count, 8, [&](int begin, int end) {
      EXPECT_EQ(begin % 8, 0);
      EXPECT_LE(end - begin, 8);
      for (int i = begin; i < end; ++i) ++visits[static_cast<std::size_t>(i)];
    });
    for (const int visit : visits) EXPECT_EQ(visit, 1);
  }
}

TEST(ParallelFor, SameBitsOnAnyNumberOfThreads) {
  const double one = SumInChunks(1);
  EXPECT_EQ(one, SumInChunks(2));
  EXPECT_EQ(one, SumInChunks(3));
  EXPECT_EQ(one, SumInChunks(0));
}

TEST(ParallelFor, ForwardsExceptions) {
  EXPECT_THROW(ParallelFor(100, 10,
                           [](int begin, int) {
                             if (begin == 50) throw std::runtime_error("chunk 5");
                           }),
               std::runtime_error);
}

TEST(ParallelFor, RefusesBadArguments) {
  EXPECT_THROW(ParallelFor(10, 0, [](int, int) {}), std::invalid_argument);
  EXPECT_THROW(ThreadLimit(-1), std::invalid_argument);
}

}  // namespace
}  // namespace fringe_fusion
