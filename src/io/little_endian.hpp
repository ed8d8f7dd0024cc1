#pragma once

#include <cstdint>
#include <cstring>
#include <string>

namespace fringe_fusion::internal {

/// Appends numbers as little-endian bytes on any host.
inline void PutUint32(std::string& bytes, std::uint32_t value) {
  for (unsigned shift = 0; shift < 32; shift += 8) {
    bytes.push_back(static_cast<char>((value >> shift) & 0xFFU));
  }
}
inline void PutInt32(std::string& bytes, std::int32_t value) {
  PutUint32(bytes, static_cast<std::uint32_t>(value));
}
inline void PutFloat(std::string& bytes, float value) {
  std::uint32_t bits = 0;
  std::memcpy(&bits, &value, sizeof(bits));
  PutUint32(bytes, bits);
}
inline void PutByte(std::string& bytes, std::uint8_t value) {
  bytes.push_back(static_cast<char>(value));
}

/// Reads little-endian numbers; the caller has checked that the bytes are there.
inline std::uint32_t GetUint32(const char* bytes) {
  std::uint32_t value = 0;
  for (int i = 3; i >= 0; --i) value = (value << 8U) | static_cast<unsigned char>(bytes[i]);
  return value;
}
inline float GetFloat(const char* bytes) {
  const std::uint32_t bits = GetUint32(bytes);
  float value = 0.0F;
  std::memcpy(&value, &bits, sizeof(value));
  return value;
}

}  // namespace fringe_fusion::internal
