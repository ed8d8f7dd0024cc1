#pragma once

#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <vector>

namespace fringe_fusion {

/// Dense row-major image with value semantics: a copy is a copy, no shared pixels.
/// Pixel (x, y) is column x, row y; the centre of the first pixel is (0, 0).
template <typename T>
class Image {
 public:
  Image() = default;
  Image(int width, int height, const T& value = T{})
      : width_(width), height_(height), pixels_(CheckedCount(width, height), value) {}

  [[nodiscard]] int width() const { return width_; }
  [[nodiscard]] int height() const { return height_; }
  [[nodiscard]] bool empty() const { return pixels_.empty(); }
  [[nodiscard]] std::size_t size() const { return pixels_.size(); }
  [[nodiscard]] bool Contains(int x, int y) const {
    return x >= 0 && y >= 0 && x < width_ && y < height_;
  }

  T& operator()(int x, int y) { return pixels_[Index(x, y)]; }
  const T& operator()(int x, int y) const { return pixels_[Index(x, y)]; }
  T& operator[](std::size_t i) { return pixels_[i]; }
  const T& operator[](std::size_t i) const { return pixels_[i]; }
  T* row(int y) { return pixels_.data() + Index(0, y); }
  const T* row(int y) const { return pixels_.data() + Index(0, y); }
  T* data() { return pixels_.data(); }
  const T* data() const { return pixels_.data(); }
  auto begin() { return pixels_.begin(); }
  auto end() { return pixels_.end(); }
  auto begin() const { return pixels_.begin(); }
  auto end() const { return pixels_.end(); }

 private:
  static std::size_t CheckedCount(int width, int height) {
    if (width < 0 || height < 0) throw std::invalid_argument("Image: negative size");
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }
  [[nodiscard]] std::size_t Index(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }

  int width_ = 0;
  int height_ = 0;
  std::vector<T> pixels_;
};

struct Rgb8 {
  std::uint8_t r = 0;
  std::uint8_t g = 0;
  std::uint8_t b = 0;
};

}  // namespace fringe_fusion
