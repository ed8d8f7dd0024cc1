#include "src/io/ply.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>

#include "test/io/scan_fixture.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion::internal {
namespace {

using namespace test_support;  // NOLINT(google-build-using-namespace)

const char* const kHeader =
    "comment odd order, every type\nobj_info num_cols 3\nobj_info text a b c\n"
    "element vertex 2\nproperty double x\nproperty char a\nproperty uchar b\nproperty short c\n"
    "property ushort d\nproperty int e\nproperty uint f\nproperty float g\n"
    "property list short float32 h\nelement empty 0\nproperty int8 i\nend_header\n";

// All numbers of the file in order.
Result<std::vector<double>> AllNumbers(const std::string& path) {
  const auto reader = PlyReader::Open(path);
  if (!reader) return Forward(reader);
  std::vector<double> all;
  const Status status =
      reader->ReadRows([&](const PlyElement&, std::size_t, const PlyRow& row) -> Status {
        for (const auto& values : row) all.insert(all.end(), values.begin(), values.end());
        return {};
      });
  if (!status) return tl::unexpected<Error>(status.error());
  return all;
}

class BinaryWriter {
 public:
  explicit BinaryWriter(bool big) : big_(big) {}
  template <typename T>
  BinaryWriter& Put(T value) {
    std::string bytes(sizeof(T), '\0');
    std::memcpy(bytes.data(), &value, sizeof(T));
    if (big_) std::reverse(bytes.begin(), bytes.end());
    text += bytes;
    return *this;
  }
  std::string text;

 private:
  bool big_;
};

std::string Binary(bool big) {
  BinaryWriter writer(big);
  writer.Put(0.1).Put<std::int8_t>(-7).Put<std::uint8_t>(200).Put<std::int16_t>(-300);
  writer.Put<std::uint16_t>(60000).Put<std::int32_t>(-100000).Put<std::uint32_t>(4000000000U);
  writer.Put(1.5F).Put<std::int16_t>(2).Put(2.5F).Put(-3.5F);
  writer.Put(-2e100).Put<std::int8_t>(1).Put<std::uint8_t>(2).Put<std::int16_t>(3);
  writer.Put<std::uint16_t>(4).Put<std::int32_t>(5).Put<std::uint32_t>(6);
  writer.Put(7.0F).Put<std::int16_t>(0);
  return writer.text;
}

TEST(PlyReader, ReadsTheSameNumbersFromEveryFormat) {
  const TempFolder folder;
  const std::vector<double> expected = {0.1, -7,  200,  -300,   60000, -100000, 4000000000.0,
                                        1.5, 2.5, -3.5, -2e100, 1,     2,       3,
                                        4,   5,   6,    7};
  Spit(folder / "a.ply", std::string("ply\r\nformat ascii 1.0\r\n") + kHeader +
                             "0.1 -7 200 -300 60000 -100000 4000000000 1.5 2 2.5 -3.5\r\n"
                             "\n-2e100 1 2 3 +4 5 6 7 0");
  Spit(folder / "l.ply",
       std::string("ply\nformat binary_little_endian 1.0\n") + kHeader + Binary(false));
  Spit(folder / "b.ply",
       std::string("ply\nformat binary_big_endian 1.0\n") + kHeader + Binary(true));
  for (const char* name : {"a.ply", "l.ply", "b.ply"}) {
    const auto numbers = AllNumbers(folder / name);
    ASSERT_TRUE(numbers) << numbers.error().message;
    EXPECT_EQ(*numbers, expected) << name;
    EXPECT_EQ(PlyReader::Open(folder / name)->obj_info().at("text"), "a b c");
  }
}

class LyingHeader : public ::testing::Test {
 protected:
  std::string Complaint(const std::string& text) {
    Spit(path_, text);
    const std::string message = MessageOf(AllNumbers(path_));
    EXPECT_EQ(message.rfind(path_ + ": ", 0), 0U) << message;
    return message.substr(std::min(message.size(), path_.size() + 2));
  }
  static std::string Ascii(const std::string& count, const std::string& body) {
    return "ply\nformat ascii 1.0\nelement vertex " + count +
           "\nproperty float x\nproperty float y\nend_header\n" + body;
  }
  static std::string Little(const std::string& count, const std::string& body) {
    return "ply\nformat binary_little_endian 1.0\nelement face " + count +
           "\nproperty list int int v\nend_header\n" + body;
  }
  TempFolder folder_;
  std::string path_ = folder_ / "lie.ply";
};

TEST_F(LyingHeader, NamesTooManyAndTooFewRows) {
  EXPECT_EQ(Complaint(Ascii("3", "1 2\n3.25 4.25\n")),
            "the header promises 3 rows of element vertex, but the file ends after 2");
  EXPECT_EQ(Complaint(Ascii("1", "1 2\n3 4\n")), "line 8: more rows than the header promises");
  EXPECT_EQ(Complaint(Ascii("1", "1 2 3\n")),
            "line 7: row 0 of element vertex has 3 words, but its properties need 2");
  EXPECT_EQ(Complaint(Ascii("2", "1 2\n3 z\n")),
            "line 8: row 1 of element vertex has no valid y (2 words)");
  const std::string row("\1\0\0\0\5\0\0\0", 8);
  Spit(path_, Little("1", row));
  EXPECT_TRUE(AllNumbers(path_));
  EXPECT_EQ(Complaint(Little("2", row + row + row)),
            "8 bytes follow the rows that the header promises");
  EXPECT_EQ(Complaint(Little("2", row + row.substr(0, 6))),
            "the file ends in row 1 of 2 of element face: v needs 1 values, 2 bytes are left");
}

TEST_F(LyingHeader, NamesAbsurdAndNegativeCounts) {
  EXPECT_EQ(Complaint(Ascii("-5", "")),
            "line 3: element vertex has the count '-5', must be a whole number from 0");
  EXPECT_EQ(Complaint(Ascii("1e3", "")),
            "line 3: element vertex has the count '1e3', must be a whole number from 0");
  EXPECT_EQ(Complaint(Ascii("9000000000000000000", "1 2\n")),
            "the header promises 9000000000000000000 rows of element vertex of at least 4 bytes, "
            "but only 5 bytes are left");
  EXPECT_EQ(Complaint(Ascii("99999999999999999999", "")),
            "line 3: element vertex has the count '99999999999999999999', must be a whole number "
            "from 0");
  EXPECT_EQ(Complaint(Little("1", "\xff\xff\xff\x7f")),
            "the file ends in row 0 of 1 of element face: v needs 2147483647 values, 0 bytes are "
            "left");
  EXPECT_EQ(Complaint(Little("1", "\xff\xff\xff\xff")),
            "the file ends in row 0 of 1 of element face: v needs -1 values, 0 bytes are left");
}

TEST_F(LyingHeader, NamesBrokenHeaders) {
  EXPECT_EQ(Complaint(""), "not a PLY file");
  EXPECT_EQ(Complaint("solid"), "not a PLY file");
  EXPECT_EQ(Complaint("ply\nformat ascii 1.0\n"), "the header has no end_header");
  EXPECT_EQ(Complaint("ply\nend_header\n"), "the header has no format line");
  EXPECT_EQ(Complaint("ply\nformat utf8 1.0\nend_header\n"), "line 2: unknown format 'utf8'");
  EXPECT_EQ(Complaint("ply\nformat ascii 1.0\nelement v 1\nproperty half x\nend_header\n"),
            "line 4: property x has the unknown type 'half'");
  EXPECT_EQ(Complaint("ply\nformat ascii 1.0\nproperty float x\nend_header\n"),
            "line 3: property before any element");
  EXPECT_EQ(Complaint("ply\nformat ascii 1.0\nelement v 3\nend_header\n1\n2\n3\n"),
            "element v has no properties");
  EXPECT_EQ(Complaint("ply\nformat ascii 1.0\nelement v 0\nelement v 0\nend_header\n"),
            "line 4: element v occurs twice");
}

TEST_F(LyingHeader, EveryTruncationOfABinaryFileIsAnError) {
  const std::string whole =
      std::string("ply\nformat binary_little_endian 1.0\n") + kHeader + Binary(false);
  Spit(path_, whole);
  ASSERT_TRUE(AllNumbers(path_));
  for (std::size_t length = 0; length < whole.size(); ++length) {
    Spit(path_, whole.substr(0, length));
    EXPECT_FALSE(AllNumbers(path_)) << length << " of " << whole.size() << " bytes";
  }
}

}  // namespace
}  // namespace fringe_fusion::internal
