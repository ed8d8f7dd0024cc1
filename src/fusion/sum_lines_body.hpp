// To be included once per instruction set, within an unnamed namespace of its file.

using Floats = float __attribute__((vector_size(32)));
using Ints = std::int32_t __attribute__((vector_size(32)));
#define FRINGE_FUSION_LINE static inline __attribute__((always_inline))

constexpr int kLineLength = 8;

FRINGE_FUSION_LINE Floats LoadLine(const float* from) {
  Floats line;
  __builtin_memcpy(&line, from, sizeof(line));
  return line;
}

FRINGE_FUSION_LINE void AddLine(float* to, const Floats& added) {
  const Floats sum = LoadLine(to) + added;
  __builtin_memcpy(to, &sum, sizeof(sum));
}

FRINGE_FUSION_LINE Floats AtLeastZero(const Floats& x) {
  const Floats zero = {};
  return x > zero ? x : zero;
}

FRINGE_FUSION_LINE Floats AtMostOne(const Floats& x) {
  const Floats one = Floats{} + 1.0F;
  return x < one ? x : one;
}

// e^x for x <= 0, relative error 2e-7; 0 far below.
// Ref: S. Moshier, Cephes mathematical library, expf.
FRINGE_FUSION_LINE Floats ExpOfNegative(const Floats& argument) {
  const Floats least = Floats{} - 87.0F;
  const Floats x = argument > least ? argument : least;
  // The half towards minus infinity, as truncation goes towards zero.
  const Ints n = __builtin_convertvector(x * 1.44269504F - 0.5F, Ints);
  const Floats nf = __builtin_convertvector(n, Floats);
  const Floats r = x - nf * 0.693359375F + nf * 2.12194440e-4F;
  Floats p = r * 1.9875691500e-4F + 1.3981999507e-3F;
  p = p * r + 8.3334519073e-3F;
  p = p * r + 4.1665795894e-2F;
  p = p * r + 1.6666665459e-1F;
  p = p * r + 5.0000001201e-1F;
  p = p * r * r + r + 1.0F;
  return p * (Floats)((n + 127) << 23);
}

// Factors of the kernel of one sample, and the lines that it reaches.
struct Reach {
  Floats gap_x;
  Floats gap_x2;
  Floats gauss_x;
  alignas(32) float gap[2][kLineLength];  // y, z
  alignas(32) float gap2[2][kLineLength];
  alignas(32) float gauss[2][kLineLength];
  float radius2;
  float inverse_radius2;
  int first[2];
  int last[2];
};

FRINGE_FUSION_LINE int Clamped(float x) {
  return x < 0.0F ? 0 : x > 7.0F ? 7 : static_cast<int>(x);
}

FRINGE_FUSION_LINE void MakeReach(const LineSample& sample, float radius, Reach& reach) {
  const Floats voxel = {0.0F, 1.0F, 2.0F, 3.0F, 4.0F, 5.0F, 6.0F, 7.0F};
  reach.radius2 = radius * radius;
  reach.inverse_radius2 = 1.0F / reach.radius2;
  const float exponent = -0.5F * kRadiusInWidths * kRadiusInWidths * reach.inverse_radius2;
  reach.gap_x = sample.position[0] - voxel;
  reach.gap_x2 = reach.gap_x * reach.gap_x;
  reach.gauss_x = ExpOfNegative(reach.gap_x2 * exponent);
  for (int a = 0; a < 2; ++a) {
    const float position = sample.position[a + 1];
    const Floats gap = position - voxel;
    const Floats gap2 = gap * gap;
    const Floats gauss = ExpOfNegative(gap2 * exponent);
    __builtin_memcpy(reach.gap[a], &gap, sizeof(gap));
    __builtin_memcpy(reach.gap2[a], &gap2, sizeof(gap2));
    __builtin_memcpy(reach.gauss[a], &gauss, sizeof(gauss));
    reach.first[a] = Clamped(__builtin_ceilf(position - radius));
    reach.last[a] = Clamped(__builtin_floorf(position + radius));
  }
}

// Kernel on the line (y, z); zero outside the support.
FRINGE_FUSION_LINE Floats KernelOn(const Reach& reach, int y, int z, float rest) {
  const Floats taper = AtLeastZero(1.0F - (reach.gap_x2 + rest) * reach.inverse_radius2);
  return reach.gauss_x * (reach.gauss[0][y] * reach.gauss[1][z]) * taper * taper;
}

// 0 for opposite or perpendicular normals, 1 for those that agree, linear between.
FRINGE_FUSION_LINE Floats Agreement(const LineSample& sample, const float* const* sheets,
                                    int start) {
  const Floats cosine = LoadLine(sheets[0] + start) * sample.normal[0] +
                        LoadLine(sheets[1] + start) * sample.normal[1] +
                        LoadLine(sheets[2] + start) * sample.normal[2];
  return AtMostOne(AtLeastZero(cosine * (1.0F / kFullAgreementCosine)));
}

FRINGE_FUSION_LINE void AddMoments(const LineSample& sample, const Reach& reach, const Floats& k,
                                   int y, int z, const SumChannels& sums) {
  const int start = (z * kLineLength + y) * kLineLength;
  const float gap_y = reach.gap[0][y];
  const float gap_z = reach.gap[1][z];
  const Floats w = k * sample.weight;
  const Floats w_x = w * reach.gap_x;
  const float off_rest = gap_y * sample.normal[1] + gap_z * sample.normal[2] + sample.offset_normal;
  const float squared_rest = gap_y * gap_y + gap_z * gap_z + sample.offset_squared;
  AddLine(sums.weight + start, w);
  AddLine(sums.offset[0] + start, w_x);
  AddLine(sums.offset[1] + start, w * gap_y);
  AddLine(sums.offset[2] + start, w * gap_z);
  AddLine(sums.normal[0] + start, w * sample.normal[0]);
  AddLine(sums.normal[1] + start, w * sample.normal[1]);
  AddLine(sums.normal[2] + start, w * sample.normal[2]);
  AddLine(sums.offset_normal + start, w_x * sample.normal[0] + w * off_rest);
  AddLine(sums.offset_squared + start, w_x * reach.gap_x + w * squared_rest);
  AddLine(sums.variance + start, k * k * sample.weight_variance);
  AddLine(sums.color[0] + start, w * sample.color[0]);
  AddLine(sums.color[1] + start, w * sample.color[1]);
  AddLine(sums.color[2] + start, w * sample.color[2]);
}

// Calls line(y, z, squared distance in y and z) for every wanted line in reach.
template <typename Line>
FRINGE_FUSION_LINE void ForEachLine(const Reach& reach, LineMask lines, const Line& line) {
  for (int z = reach.first[1]; z <= reach.last[1]; ++z) {
    for (int y = reach.first[0]; y <= reach.last[0]; ++y) {
      const float rest = reach.gap2[0][y] + reach.gap2[1][z];
      if (((lines >> (z * kLineLength + y)) & 1U) == 0 || !(rest < reach.radius2)) continue;
      line(y, z, rest);
    }
  }
}

void AddToSums(const LineSample& sample, float radius, const float* const* sheets, LineMask lines,
               const SumChannels& sums) {
  Reach reach;
  MakeReach(sample, radius, reach);
  if (sheets == nullptr) {
    ForEachLine(
        reach, lines, [&](int y, int z, float rest) __attribute__((always_inline)) {
          AddMoments(sample, reach, KernelOn(reach, y, z, rest), y, z, sums);
        });
    return;
  }
  ForEachLine(
      reach, lines, [&](int y, int z, float rest) __attribute__((always_inline)) {
        const int start = (z * kLineLength + y) * kLineLength;
        const Floats k = KernelOn(reach, y, z, rest) * Agreement(sample, sheets, start);
        AddMoments(sample, reach, k, y, z, sums);
      });
}

void AddToSheets(const LineSample& sample, float radius, const SheetChannels& sheets) {
  Reach reach;
  MakeReach(sample, radius, reach);
  ForEachLine(
      reach, ~LineMask{0}, [&](int y, int z, float rest) __attribute__((always_inline)) {
        const int start = (z * kLineLength + y) * kLineLength;
        const Floats k = KernelOn(reach, y, z, rest);
        const Floats k4 = k * k * (k * k);
        AddLine(sheets.weight + start, k4);
        const Floats distance2 = reach.gap_x2 + rest;
        const Floats before = LoadLine(sheets.nearest2 + start);
        const Ints nearer = distance2 < before;
        const Floats nearest2 = nearer ? distance2 : before;
        __builtin_memcpy(sheets.nearest2 + start, &nearest2, sizeof(nearest2));
        for (int axis = 0; axis < 3; ++axis) {
          AddLine(sheets.sum[axis] + start, k4 * sample.normal[axis]);
          const Floats nearest =
              nearer ? Floats{} + sample.normal[axis] : LoadLine(sheets.nearest[axis] + start);
          __builtin_memcpy(sheets.nearest[axis] + start, &nearest, sizeof(nearest));
        }
      });
}

constexpr LineKernels kLineKernels{AddToSums, AddToSheets};
