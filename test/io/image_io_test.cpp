#include "fringe_fusion/io/image_io.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <limits>

#include "fringe_fusion/io/file.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using test_support::TempFolder;

Image<std::uint8_t> GrayRamp(int width, int height) {
  Image<std::uint8_t> image(width, height);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) image(x, y) = static_cast<std::uint8_t>(7 * x + 31 * y * y);
  }
  return image;
}

void WriteBytes(const std::string& path, const std::string& bytes) {
  std::ofstream(path, std::ios::binary).write(bytes.data(), static_cast<long>(bytes.size()));
}

template <typename T>
void ExpectSamePixels(const Image<T>& a, const Image<T>& b) {
  ASSERT_EQ(a.width(), b.width());
  ASSERT_EQ(a.height(), b.height());
  EXPECT_EQ(std::memcmp(a.data(), b.data(), a.size() * sizeof(T)), 0);
}

TEST(ImageIo, KeepsEveryBitOfGrayImages) {
  const TempFolder folder;
  const Image<std::uint8_t> bytes = GrayRamp(37, 21);
  Image<std::uint16_t> words(37, 21);
  for (std::size_t i = 0; i < words.size(); ++i) words[i] = static_cast<std::uint16_t>(i * 997);
  for (const char* extension : {".png", ".tiff"}) {
    ASSERT_TRUE(WriteImage(FramePixels(bytes), folder / "b" + extension));
    ASSERT_TRUE(WriteImage(FramePixels(words), folder / "w" + extension));
    const auto b = ReadGrayImage(folder / "b" + extension);
    const auto w = ReadGrayImage(folder / "w" + extension);
    ASSERT_TRUE(b && w);
    ExpectSamePixels(std::get<Image<std::uint8_t>>(*b), bytes);
    ExpectSamePixels(std::get<Image<std::uint16_t>>(*w), words);
  }
}

TEST(ImageIo, KeepsColorAndChannelOrder) {
  const TempFolder folder;
  Image<Rgb8> image(5, 4);
  for (std::size_t i = 0; i < image.size(); ++i) {
    image[i] = {static_cast<std::uint8_t>(10 * i), static_cast<std::uint8_t>(200 - i), 3};
  }
  ASSERT_TRUE(WriteImage(image, folder / "c.png"));
  const auto read = ReadColorImage(folder / "c.png");
  ASSERT_TRUE(read);
  ExpectSamePixels(*read, image);
  // Grey of a pure red picture is .299 of it: the channels are not swapped.
  ASSERT_TRUE(WriteImage(Image<Rgb8>(4, 4, Rgb8{200, 0, 0}), folder / "r.png"));
  const auto gray = ReadGrayImage(folder / "r.png");
  ASSERT_TRUE(gray);
  EXPECT_NEAR(std::get<Image<std::uint8_t>>(*gray)(1, 1), 60, 1);
}

TEST(ImageIo, KeepsEveryBitOfFloatsIncludingNan) {
  const TempFolder folder;
  Image<float> image(33, 70);
  for (std::size_t i = 0; i < image.size(); ++i) image[i] = std::sin(static_cast<float>(i)) * 1e3F;
  image(3, 4) = std::numeric_limits<float>::quiet_NaN();
  image(4, 4) = -0.0F;
  image(5, 4) = std::numeric_limits<float>::denorm_min();
  ASSERT_TRUE(WriteImage(image, folder / "f.tiff"));
  const auto read = ReadFloatImage(folder / "f.tiff");
  ASSERT_TRUE(read) << read.error().message;
  ExpectSamePixels(*read, image);
}

TEST(ImageIo, RefusesEveryTruncation) {
  const TempFolder folder;
  Image<float> floats(60, 50, 1.5F);
  ASSERT_TRUE(WriteImage(GrayRamp(120, 100), folder / "a.png"));
  ASSERT_TRUE(WriteImage(GrayRamp(120, 100), folder / "a.jpg"));
  ASSERT_TRUE(WriteImage(GrayRamp(120, 100), folder / "a.tiff"));
  ASSERT_TRUE(WriteImage(floats, folder / "f.tiff"));
  for (const char* name : {"a.png", "a.jpg", "a.tiff", "f.tiff"}) {
    const bool is_float = std::string(name) == "f.tiff";
    const std::string bytes = *ReadFile(folder / name);
    const auto reads = [&](const std::string& content) {
      WriteBytes(folder / "cut", content);
      return is_float ? bool(ReadFloatImage(folder / "cut")) : bool(ReadGrayImage(folder / "cut"));
    };
    ASSERT_TRUE(reads(bytes)) << name;
    for (int percent = 0; percent < 100; percent += 9) {
      const std::size_t length = bytes.size() * static_cast<std::size_t>(percent) / 100;
      EXPECT_FALSE(reads(bytes.substr(0, length))) << name << " cut at " << percent << " %";
    }
    EXPECT_FALSE(reads(bytes.substr(0, bytes.size() - 1))) << name << " without its last byte";
  }
}

TEST(ImageIo, SaysWhatIsWrongWithAFile) {
  const TempFolder folder;
  const auto message = [&](const std::string& name) {
    const auto image = ReadGrayImage(folder / name);
    return image ? std::string() : image.error().message;
  };
  EXPECT_EQ(message("none.png"),
            (folder / "none.png") + ": cannot be read: No such file or directory");
  WriteBytes(folder / "text.png", "hello");
  EXPECT_EQ(message("text.png"), (folder / "text.png") + ": not a PNG, JPG or TIFF image");
  WriteBytes(folder / "empty.png", "");
  EXPECT_EQ(message("empty.png"), (folder / "empty.png") + ": empty file");

  ASSERT_TRUE(WriteImage(GrayRamp(64, 64), folder / "a.png"));
  std::string bytes = *ReadFile(folder / "a.png");
  const std::string whole = bytes;
  bytes[bytes.size() / 2] = static_cast<char>(bytes[bytes.size() / 2] ^ 1);
  WriteBytes(folder / "flip.png", bytes);
  EXPECT_NE(message("flip.png").find("damaged PNG: wrong checksum"), std::string::npos);
  WriteBytes(folder / "cut.png", whole.substr(0, whole.size() / 2));
  EXPECT_NE(message("cut.png").find("truncated PNG"), std::string::npos);

  ASSERT_TRUE(WriteImage(Image<float>(8, 8, 1.0F), folder / "f.tiff"));
  EXPECT_NE(message("f.tiff").find("must have 8 or 16 bit"), std::string::npos);
  ASSERT_FALSE(ReadFloatImage(folder / "a.png"));
}

TEST(ImageIo, RefusesToWriteWhatAFormatCannotHold) {
  const TempFolder folder;
  EXPECT_FALSE(WriteImage(Image<float>(4, 4), folder / "f.png"));
  EXPECT_FALSE(WriteImage(FramePixels(Image<std::uint16_t>(4, 4)), folder / "w.jpg"));
  EXPECT_FALSE(WriteImage(GrayRamp(4, 4), folder / "a.xyz"));
  EXPECT_FALSE(WriteImage(Image<std::uint8_t>(), folder / "a.png"));
  EXPECT_FALSE(WriteImage(Image<Rgb8>(), folder / "a.png"));
  EXPECT_FALSE(WriteImage(GrayRamp(4, 4), folder / "no/a.png"));
}

}  // namespace
}  // namespace fringe_fusion
