#include "fringe_fusion/io/image_io.hpp"

#include <array>
#include <cctype>
#include <cstring>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "extension.hpp"
#include "fringe_fusion/io/file.hpp"

namespace fringe_fusion {
namespace {

using Bytes = std::string;

std::uint32_t ReadBigEndian32(const Bytes& bytes, std::size_t at) {
  std::uint32_t value = 0;
  for (std::size_t i = 0; i < 4; ++i) {
    value = (value << 8U) | static_cast<unsigned char>(bytes[at + i]);
  }
  return value;
}

// CRC-32 of ISO 3309 as PNG uses it.
std::uint32_t Crc32(const char* data, std::size_t size) {
  std::array<std::uint32_t, 256> table{};
  for (std::uint32_t n = 0; n < 256; ++n) {
    std::uint32_t c = n;
    for (int k = 0; k < 8; ++k) c = (c & 1U) != 0U ? 0xEDB88320U ^ (c >> 1U) : c >> 1U;
    table[n] = c;
  }
  std::uint32_t crc = 0xFFFFFFFFU;
  for (std::size_t i = 0; i < size; ++i) {
    crc = table[(crc ^ static_cast<unsigned char>(data[i])) & 0xFFU] ^ (crc >> 8U);
  }
  return crc ^ 0xFFFFFFFFU;
}

// The decoders of OpenCV hand out the upper part of a truncated file as if it were whole: check
// the container first.
Status CheckPng(const Bytes& bytes, const std::string& path) {
  std::size_t at = 8;
  while (true) {
    if (at + 12 > bytes.size()) {
      return Fail("{}: truncated PNG: ends at byte {} before the IEND chunk", path, bytes.size());
    }
    const std::size_t length = ReadBigEndian32(bytes, at);
    if (length > bytes.size() - at - 12) {
      return Fail("{}: truncated PNG: a chunk of {} bytes at byte {} exceeds the file of {} bytes",
                  path, length, at, bytes.size());
    }
    if (Crc32(bytes.data() + at + 4, length + 4) != ReadBigEndian32(bytes, at + 8 + length)) {
      return Fail("{}: damaged PNG: wrong checksum of the chunk at byte {}", path, at);
    }
    if (bytes.compare(at + 4, 4, "IEND") == 0) return {};
    at += length + 12;
  }
}

Status CheckJpeg(const Bytes& bytes, const std::string& path) {
  const auto byte = [&](std::size_t i) { return static_cast<unsigned char>(bytes[i]); };
  std::size_t at = 2;
  while (at + 1 < bytes.size()) {
    if (byte(at) != 0xFF) {  // entropy coded data after a scan header
      ++at;
      continue;
    }
    const unsigned marker = byte(at + 1);
    if (marker == 0xD9) return {};
    const bool has_no_length =
        marker == 0x00 || marker == 0x01 || marker == 0xFF || (marker >= 0xD0 && marker <= 0xD8);
    if (has_no_length) {
      at += marker == 0xFF ? 1 : 2;
      continue;
    }
    if (at + 3 >= bytes.size()) break;
    at += 2 + ((static_cast<std::size_t>(byte(at + 2)) << 8U) | byte(at + 3));
  }
  return Fail("{}: truncated JPG: {} bytes without an end marker", path, bytes.size());
}

Status CheckContainer(const Bytes& bytes, const std::string& path) {
  if (bytes.empty()) return Fail("{}: empty file", path);
  if (bytes.compare(0, 8, "\x89PNG\r\n\x1a\n") == 0) return CheckPng(bytes, path);
  if (bytes.compare(0, 2, "\xFF\xD8") == 0) return CheckJpeg(bytes, path);
  const bool tiff = bytes.compare(0, 4, std::string("II*\0", 4)) == 0 ||
                    bytes.compare(0, 4, std::string("MM\0*", 4)) == 0;
  if (!tiff) return Fail("{}: not a PNG, JPG or TIFF image", path);
  return {};
}

Result<cv::Mat> Decode(const std::string& path, int flags) {
  const Result<std::string> bytes = ReadFile(path);
  if (!bytes) return Forward(bytes);
  if (Status status = CheckContainer(*bytes, path); !status) {
    return tl::unexpected<Error>(status.error());
  }
  cv::Mat decoded;
  try {
    const cv::Mat buffer(1, static_cast<int>(bytes->size()), CV_8UC1,
                         const_cast<char*>(bytes->data()));  // imdecode only reads
    decoded = cv::imdecode(buffer, flags);
  } catch (const cv::Exception& exception) {
    return Fail("{}: cannot be decoded: {}", path, exception.err);
  }
  if (decoded.empty()) return Fail("{}: cannot be decoded: truncated or damaged", path);
  return decoded;
}

template <typename T>
Image<T> FromMat(const cv::Mat& mat) {
  Image<T> image(mat.cols, mat.rows);
  for (int y = 0; y < mat.rows; ++y) {
    std::memcpy(image.row(y), mat.ptr(y), static_cast<std::size_t>(mat.cols) * sizeof(T));
  }
  return image;
}

// A view on the pixels; the image must outlive it. OpenCV only reads them.
template <typename T>
cv::Mat ViewMat(const Image<T>& image, int type) {
  return cv::Mat(image.height(), image.width(), type, const_cast<T*>(image.data()));
}

Status Encode(const cv::Mat& mat, const std::string& path) {
  const std::string extension = internal::LowerExtension(path);
  const bool tiff = extension == ".tif" || extension == ".tiff";
  const bool jpg = extension == ".jpg" || extension == ".jpeg";
  if (!tiff && !jpg && extension != ".png") {
    return Fail("{}: unknown image format '{}', must be .png, .jpg or .tiff", path, extension);
  }
  if (mat.depth() == CV_32F && !tiff) return Fail("{}: a float image must be a .tiff", path);
  if (mat.depth() == CV_16U && jpg) return Fail("{}: a 16-bit image must be .png or .tiff", path);
  if (mat.empty()) return Fail("{}: the image to write is empty", path);
  std::vector<unsigned char> bytes;
  try {
    if (!cv::imencode(extension, mat, bytes)) return Fail("{}: cannot be encoded", path);
  } catch (const cv::Exception& exception) {
    return Fail("{}: cannot be encoded: {}", path, exception.err);
  }
  const auto write = [&](std::ostream& stream) -> Status {
    stream.write(reinterpret_cast<const char*>(bytes.data()),
                 static_cast<std::streamsize>(bytes.size()));
    return {};
  };
  // A scan has hundreds of frames: waiting for the disk after each would dominate its time.
  return WriteAtomically(path, write, Durability::kClosed);
}

}  // namespace

Result<FramePixels> ReadGrayImage(const std::string& path) {
  // Frames are measurements on the sensor's grid: a rotation hint of the camera is not applied.
  const Result<cv::Mat> mat =
      Decode(path, cv::IMREAD_GRAYSCALE | cv::IMREAD_ANYDEPTH | cv::IMREAD_IGNORE_ORIENTATION);
  if (!mat) return Forward(mat);
  if (mat->type() == CV_8UC1) return FramePixels(FromMat<std::uint8_t>(*mat));
  if (mat->type() == CV_16UC1) return FramePixels(FromMat<std::uint16_t>(*mat));
  return Fail("{}: a frame must have 8 or 16 bit per pixel, this has {}", path,
              8 * mat->elemSize1());
}

Result<Image<Rgb8>> ReadColorImage(const std::string& path) {
  const Result<cv::Mat> mat = Decode(path, cv::IMREAD_COLOR | cv::IMREAD_IGNORE_ORIENTATION);
  if (!mat) return Forward(mat);
  cv::Mat rgb;
  cv::cvtColor(*mat, rgb, cv::COLOR_BGR2RGB);
  return FromMat<Rgb8>(rgb);
}

Result<Image<float>> ReadFloatImage(const std::string& path) {
  const Result<cv::Mat> mat = Decode(path, cv::IMREAD_UNCHANGED);
  if (!mat) return Forward(mat);
  if (mat->type() != CV_32FC1) {
    return Fail("{}: must be a 32-bit float image of one channel, this has {} of {} bit", path,
                mat->channels(), 8 * mat->elemSize1());
  }
  return FromMat<float>(*mat);
}

Status WriteImage(const FramePixels& image, const std::string& path) {
  if (const auto* bytes = std::get_if<Image<std::uint8_t>>(&image)) return WriteImage(*bytes, path);
  return Encode(ViewMat(std::get<Image<std::uint16_t>>(image), CV_16UC1), path);
}

Status WriteImage(const Image<std::uint8_t>& image, const std::string& path) {
  return Encode(ViewMat(image, CV_8UC1), path);
}

Status WriteImage(const Image<Rgb8>& image, const std::string& path) {
  static_assert(sizeof(Rgb8) == 3, "pixels are copied as three bytes");
  cv::Mat bgr;
  if (!image.empty()) cv::cvtColor(ViewMat(image, CV_8UC3), bgr, cv::COLOR_RGB2BGR);
  return Encode(bgr, path);
}

Status WriteImage(const Image<float>& image, const std::string& path) {
  return Encode(ViewMat(image, CV_32FC1), path);
}

}  // namespace fringe_fusion
