#include "fringe_fusion/io/target_drawing.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <regex>

#include "fringe_fusion/calibration/detect_target.hpp"
#include "test/support/temp_folder.hpp"

namespace fringe_fusion {
namespace {

using test_support::TempFolder;

constexpr double kPixelsPerMm = 3.0;

std::string Text(const std::string& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), {}};
}

/// One element of a drawing in millimetres.
struct Element {
  bool is_disc = false;
  double x = 0.0;  ///< left edge, or centre
  double y = 0.0;
  double width = 0.0;  ///< or radius
  double height = 0.0;
  double grey = 0.0;  ///< 0 to 1
};

/// Paints elements in their order on white paper, 4 x 4 samples a pixel.
Image<float> Paint(const std::vector<Element>& elements, double width_mm, double height_mm) {
  Image<float> picture(static_cast<int>(width_mm * kPixelsPerMm),
                       static_cast<int>(height_mm * kPixelsPerMm), 220.0F);
  for (const Element& e : elements) {
    const double left = e.is_disc ? e.x - e.width : e.x;
    const double top = e.is_disc ? e.y - e.width : e.y;
    const double size_x = e.is_disc ? 2.0 * e.width : e.width;
    const double size_y = e.is_disc ? 2.0 * e.width : e.height;
    for (int y = static_cast<int>(top * kPixelsPerMm) - 1; y <= (top + size_y) * kPixelsPerMm;
         ++y) {
      for (int x = static_cast<int>(left * kPixelsPerMm) - 1; x <= (left + size_x) * kPixelsPerMm;
           ++x) {
        if (!picture.Contains(x, y)) continue;
        int inside = 0;
        for (int k = 0; k < 16; ++k) {
          // Pixel (0, 0) covers the first 1 / kPixelsPerMm of the sheet.
          const double px = (x + (k % 4 + 0.5) / 4.0) / kPixelsPerMm;
          const double py = (y + (k / 4 + 0.5) / 4.0) / kPixelsPerMm;
          const bool is_in = e.is_disc
                                 ? std::hypot(px - e.x, py - e.y) < e.width
                                 : px > left && px < left + size_x && py > top && py < top + size_y;
          inside += is_in ? 1 : 0;
        }
        const auto share = static_cast<float>(inside) / 16.0F;
        picture(x, y) += share * (static_cast<float>(20.0 + 200.0 * e.grey) - picture(x, y));
      }
    }
  }
  return picture;
}

std::vector<Element> ReadSvg(const std::string& svg) {
  std::vector<Element> elements;
  const std::regex tag("<(rect|circle) ([^>]*)/>");
  const std::regex attribute("([a-z]+)=\"#?([0-9a-f.]+)\"");
  for (std::sregex_iterator it(svg.begin(), svg.end(), tag), end; it != end; ++it) {
    std::map<std::string, std::string> values;
    const std::string list = (*it)[2];
    for (std::sregex_iterator a(list.begin(), list.end(), attribute); a != end; ++a) {
      values[(*a)[1]] = (*a)[2];
    }
    Element e;
    e.is_disc = (*it)[1] == "circle";
    e.x = std::stod(values[e.is_disc ? "cx" : "x"]);
    e.y = std::stod(values[e.is_disc ? "cy" : "y"]);
    e.width = std::stod(values[e.is_disc ? "r" : "width"]);
    e.height = e.is_disc ? 0.0 : std::stod(values["height"]);
    e.grey = std::stoi(values["fill"].substr(0, 2), nullptr, 16) / 255.0;
    elements.push_back(e);
  }
  return elements;
}

CalibrationTarget Target(TargetKind kind) {
  CalibrationTarget target;
  target.kind = kind;
  target.num_columns = 8;
  target.num_rows = 7;
  target.pitch_m = 0.018;
  if (HasDots(kind)) target.dot_radius_m = 0.004;
  if (kind == TargetKind::kRingDots) {
    target.ring_radius_m = 0.0085;
    target.print_ratio = 0.5;
  }
  if (kind == TargetKind::kCharuco) target.marker_m = 0.013;
  if (kind == TargetKind::kShiftedDots) target.num_shifts = 4;
  return target;
}

TEST(TargetDrawing, SvgIsSeenAtItsSize) {
  const TempFolder folder;
  for (const TargetKind kind :
       {TargetKind::kChessboard, TargetKind::kCharuco, TargetKind::kCircles,
        TargetKind::kAsymmetricCircles, TargetKind::kRingDots, TargetKind::kShiftedDots}) {
    const CalibrationTarget target = Target(kind);
    const Status drawn = DrawTarget(target, *PaperFromName("a4"), folder / "target.svg");
    ASSERT_TRUE(drawn) << drawn.error().message;
    const std::string svg = Text(folder / "target.svg");
    std::smatch size;
    ASSERT_TRUE(
        std::regex_search(svg, size, std::regex("width=\"([0-9.]+)mm\" height=\"([0-9.]+)mm\"")));
    const auto picture = Paint(ReadSvg(svg), std::stod(size[1]), std::stod(size[2]));
    const auto sighting = DetectTarget(picture, target, {});
    ASSERT_TRUE(sighting) << TargetKindName(kind) << ": " << sighting.error().message;
    ASSERT_EQ(sighting->points.size(), 56U) << TargetKindName(kind);
    const auto points = TargetPoints(target);
    const Eigen::Vector2d first = sighting->points[0].pixel_camera;
    const double sign = sighting->points[7].pixel_camera.x() > first.x() ? 1.0 : -1.0;
    for (const PointSighting& p : sighting->points) {
      const Eigen::Vector2d expected =
          1e3 * kPixelsPerMm * points[static_cast<std::size_t>(p.point)].head<2>();
      EXPECT_LT((sign * (p.pixel_camera - first) - expected).norm(), 0.1) << TargetKindName(kind);
    }
  }
}

TEST(TargetDrawing, PdfHasThePageAndTheShapesOfTheSvg) {
  const TempFolder folder;
  const CalibrationTarget target = Target(TargetKind::kChessboard);
  ASSERT_TRUE(DrawTarget(target, *PaperFromName("a4"), folder / "t.pdf"));
  ASSERT_TRUE(DrawTarget(target, *PaperFromName("a4"), folder / "t.svg"));
  const std::string pdf = Text(folder / "t.pdf");
  EXPECT_EQ(pdf.rfind("%PDF-1.4\n", 0), 0U);
  std::smatch box;
  ASSERT_TRUE(std::regex_search(pdf, box, std::regex("MediaBox \\[0 0 ([0-9.]+) ([0-9.]+)\\]")));
  EXPECT_NEAR(std::stod(box[1]) * 25.4 / 72.0, 210.0, 1e-3);
  EXPECT_NEAR(std::stod(box[2]) * 25.4 / 72.0, 297.0, 1e-3);
  std::smatch scale;
  ASSERT_TRUE(
      std::regex_search(pdf, scale, std::regex("\n([0-9.]+) 0 0 -([0-9.]+) 0 ([0-9.]+) cm")));
  EXPECT_NEAR(std::stod(scale[1]), 72.0 / 25.4, 1e-6);
  EXPECT_NEAR(std::stod(scale[3]), 297.0 * 72.0 / 25.4, 1e-3);
  std::vector<std::string> squares;
  const std::regex square("\n([0-9.]+ [0-9.]+ [0-9.]+ [0-9.]+) re f");
  for (std::sregex_iterator it(pdf.begin(), pdf.end(), square), end; it != end; ++it) {
    squares.push_back((*it)[1]);
  }
  const std::vector<Element> elements = ReadSvg(Text(folder / "t.svg"));
  ASSERT_EQ(squares.size(), elements.size());
  for (std::size_t i = 0; i < squares.size(); ++i) {
    EXPECT_EQ(squares[i], fmt::format("{:.6f} {:.6f} {:.6f} {:.6f}", elements[i].x, elements[i].y,
                                      elements[i].width, elements[i].height));
  }
  // The table of objects points at them.
  const std::size_t table = pdf.find("xref\n");
  EXPECT_NE(pdf.find(fmt::format("startxref\n{}\n", table)), std::string::npos);
  for (int i = 1; i <= 5; ++i) {
    const std::size_t line = pdf.find("0000000000 65535 f \n") + static_cast<std::size_t>(20 * i);
    const std::size_t offset = std::stoul(pdf.substr(line, 10));
    EXPECT_EQ(pdf.compare(offset, 8, fmt::format("{} 0 obj\n", i)), 0) << i;
  }
}

TEST(TargetDrawing, TurnsTheSheetWhereThatHelps) {
  const TempFolder folder;
  CalibrationTarget target = Target(TargetKind::kCircles);
  target.num_columns = 13;
  ASSERT_TRUE(DrawTarget(target, *PaperFromName("a4"), folder / "t.svg"));
  EXPECT_NE(Text(folder / "t.svg").find("width=\"297mm\" height=\"210mm\""), std::string::npos);
}

TEST(TargetDrawing, RefusesWhatDoesNotFit) {
  const TempFolder folder;
  CalibrationTarget target = Target(TargetKind::kChessboard);
  target.pitch_m = 0.05;
  const Status status = DrawTarget(target, *PaperFromName("a4"), folder / "t.pdf");
  ASSERT_FALSE(status);
  EXPECT_NE(status.error().message.find("the print is 490.0 x 440.0 mm"), std::string::npos)
      << status.error().message;
  EXPECT_NE(status.error().message.find("a sheet of 210.0 x 297.0 mm holds 202.0 x 289.0 mm"),
            std::string::npos);
  EXPECT_TRUE(DrawTarget(target, *PaperFromName("600x500"), folder / "t.pdf"));
  EXPECT_FALSE(DrawTarget(target, *PaperFromName("a0"), folder / "t.png"));
  target.num_rows = 0;
  EXPECT_FALSE(DrawTarget(target, *PaperFromName("a0"), folder / "t.pdf"));
}

TEST(TargetDrawing, KnowsItsPapers) {
  for (const std::string& name : PaperNames()) EXPECT_TRUE(PaperFromName(name)) << name;
  for (const char* name : {"b4", "", "10x10", "300x", "300x200mm", "nanx200", "9000x200"}) {
    const auto paper = PaperFromName(name);
    ASSERT_FALSE(paper) << name;
    EXPECT_NE(paper.error().message.find("must be one of a5, a4"), std::string::npos);
  }
}

}  // namespace
}  // namespace fringe_fusion
