#include "fringe_fusion/io/target_drawing.hpp"

#include <array>
#include <cmath>
#include <filesystem>
#include <sstream>
#include <utility>

#include "fringe_fusion/calibration/target_print.hpp"
#include "fringe_fusion/io/file.hpp"

namespace fringe_fusion {
namespace {

constexpr double kMmPerMetre = 1e3;
constexpr double kPointsPerMm = 72.0 / 25.4;
constexpr double kUnprintable_mm = 4.0;  // border that printers leave
constexpr double kCaption_mm = 10.0;     // height of the line of 100 mm with its words

struct NamedPaper {
  const char* name;
  Paper paper;
};
constexpr std::array<NamedPaper, 9> kPapers = {{{"a5", {148.0, 210.0}},
                                                {"a4", {210.0, 297.0}},
                                                {"a3", {297.0, 420.0}},
                                                {"a2", {420.0, 594.0}},
                                                {"a1", {594.0, 841.0}},
                                                {"a0", {841.0, 1189.0}},
                                                {"letter", {215.9, 279.4}},
                                                {"legal", {215.9, 355.6}},
                                                {"tabloid", {279.4, 431.8}}}};

/// The sheet as it is used, and where the target's frame lies on it [mm], y downwards.
struct Sheet {
  double width_mm = 0.0;
  double height_mm = 0.0;
  Eigen::Vector2d origin_mm = Eigen::Vector2d::Zero();
  bool has_caption = false;
  double caption_y_mm = 0.0;
};

Result<Sheet> LayOut(const TargetPrint& print, const Paper& paper, const std::string& path) {
  const Eigen::Vector2d size_mm = kMmPerMetre * (print.max_m - print.min_m);
  const auto fits = [&](double width_mm, double height_mm) {
    return size_mm.x() <= width_mm - 2.0 * kUnprintable_mm &&
           size_mm.y() <= height_mm - 2.0 * kUnprintable_mm;
  };
  Sheet sheet;
  if (fits(paper.width_mm, paper.height_mm)) {
    sheet.width_mm = paper.width_mm;
    sheet.height_mm = paper.height_mm;
  } else if (fits(paper.height_mm, paper.width_mm)) {
    sheet.width_mm = paper.height_mm;
    sheet.height_mm = paper.width_mm;
  } else {
    return Fail(
        "{}: the print is {:.1f} x {:.1f} mm with its margin, a sheet of {:.1f} x {:.1f} mm holds "
        "{:.1f} x {:.1f} mm",
        path, size_mm.x(), size_mm.y(), paper.width_mm, paper.height_mm,
        paper.width_mm - 2.0 * kUnprintable_mm, paper.height_mm - 2.0 * kUnprintable_mm);
  }
  const double free_mm = sheet.height_mm - 2.0 * kUnprintable_mm - size_mm.y();
  sheet.has_caption = free_mm >= kCaption_mm && sheet.width_mm >= 110.0 + 2.0 * kUnprintable_mm;
  const double below_mm = sheet.has_caption ? kCaption_mm : 0.0;
  const Eigen::Vector2d corner_mm(0.5 * (sheet.width_mm - size_mm.x()),
                                  0.5 * (sheet.height_mm - below_mm - size_mm.y()));
  sheet.origin_mm = corner_mm - kMmPerMetre * print.min_m;
  sheet.caption_y_mm = sheet.height_mm - kUnprintable_mm - 0.3 * kCaption_mm;
  return sheet;
}

std::string Caption(const CalibrationTarget& target) {
  return fmt::format("{} {} x {}, pitch {:g} mm; print at 100 %, this line is 100 mm long",
                     TargetKindName(target.kind), target.num_columns, target.num_rows,
                     kMmPerMetre * target.pitch_m);
}

/// The ground where it is not the white of the paper.
PrintShape Ground(const TargetPrint& print) {
  return {false, 0.5 * (print.min_m + print.max_m), 0.5 * (print.max_m - print.min_m),
          print.ground_lightness, 1.0};
}

std::string Svg(const CalibrationTarget& target, const TargetPrint& print, const Sheet& sheet) {
  std::ostringstream svg;
  svg << fmt::format(
      "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n"
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}mm\" height=\"{1}mm\" "
      "viewBox=\"0 0 {0} {1}\">\n",
      sheet.width_mm, sheet.height_mm);
  const auto draw = [&](const PrintShape& shape) {
    const Eigen::Vector2d centre = sheet.origin_mm + kMmPerMetre * shape.centre_m;
    const Eigen::Vector2d half = kMmPerMetre * shape.half_size_m;
    const int grey = static_cast<int>(std::lround(255.0 * shape.lightness));
    if (shape.is_disc) {
      svg << fmt::format("<circle cx=\"{:.6f}\" cy=\"{:.6f}\" r=\"{:.6f}\" ", centre.x(),
                         centre.y(), half.x());
    } else {
      svg << fmt::format("<rect x=\"{:.6f}\" y=\"{:.6f}\" width=\"{:.6f}\" height=\"{:.6f}\" ",
                         centre.x() - half.x(), centre.y() - half.y(), 2.0 * half.x(),
                         2.0 * half.y());
    }
    svg << fmt::format("fill=\"#{0:02x}{0:02x}{0:02x}\"/>\n", grey);
  };
  if (print.ground_lightness < 1.0) draw(Ground(print));
  for (const PrintShape& shape : print.shapes) draw(shape);
  if (sheet.has_caption) {
    const double left = 0.5 * sheet.width_mm - 50.0;
    svg << fmt::format(
        "<path d=\"M {0:.3f} {1:.3f} h 100 m -100 -1 v 2 m 100 -2 v 2\" stroke=\"black\" "
        "stroke-width=\"0.2\" fill=\"none\"/>\n"
        "<text x=\"{0:.3f}\" y=\"{2:.3f}\" font-family=\"Helvetica, sans-serif\" "
        "font-size=\"3\">{3}</text>\n",
        left, sheet.caption_y_mm, sheet.caption_y_mm - 2.0, Caption(target));
  }
  svg << "</svg>\n";
  return svg.str();
}

/// Path of a shape in PDF operators, filled.
std::string PdfShape(const PrintShape& shape, const Sheet& sheet) {
  const Eigen::Vector2d c = sheet.origin_mm + kMmPerMetre * shape.centre_m;
  const Eigen::Vector2d half = kMmPerMetre * shape.half_size_m;
  std::string text = fmt::format("{:.4f} g\n", shape.lightness);
  if (!shape.is_disc) {
    return text + fmt::format("{:.6f} {:.6f} {:.6f} {:.6f} re f\n", c.x() - half.x(),
                              c.y() - half.y(), 2.0 * half.x(), 2.0 * half.y());
  }
  // Eight arcs: a Bezier curve over 45 degrees leaves the circle by 4e-6 of its radius.
  constexpr int kNumArcs = 8;
  const double step = 2.0 * std::acos(-1.0) / kNumArcs;
  const double handle = 4.0 / 3.0 * std::tan(0.25 * step) * half.x();
  const auto on_rim = [&](int k) {
    return Eigen::Vector2d(c + half.x() * Eigen::Vector2d(std::cos(step * k), std::sin(step * k)));
  };
  const auto along = [&](int k) {
    return Eigen::Vector2d(handle * Eigen::Vector2d(-std::sin(step * k), std::cos(step * k)));
  };
  text += fmt::format("{:.6f} {:.6f} m\n", on_rim(0).x(), on_rim(0).y());
  for (int k = 0; k < kNumArcs; ++k) {
    const Eigen::Vector2d a = on_rim(k) + along(k);
    const Eigen::Vector2d b = on_rim(k + 1) - along(k + 1);
    const Eigen::Vector2d end = on_rim(k + 1);
    text += fmt::format("{:.6f} {:.6f} {:.6f} {:.6f} {:.6f} {:.6f} c\n", a.x(), a.y(), b.x(), b.y(),
                        end.x(), end.y());
  }
  return text + "f\n";
}

std::string PdfContent(const CalibrationTarget& target, const TargetPrint& print,
                       const Sheet& sheet) {
  std::string content;
  if (sheet.has_caption) {
    const double left = kPointsPerMm * (0.5 * sheet.width_mm - 50.0);
    const double y = kPointsPerMm * (sheet.height_mm - sheet.caption_y_mm);
    const double tick = kPointsPerMm;
    const double right = left + 100.0 * kPointsPerMm;
    content += fmt::format("0 G 0.5 w {0:.6f} {1:.6f} m {2:.6f} {1:.6f} l S\n", left, y, right);
    for (const double x : {left, right}) {
      content += fmt::format("{0:.6f} {1:.6f} m {0:.6f} {2:.6f} l S\n", x, y - tick, y + tick);
    }
    content += fmt::format("BT /F1 8.5 Tf {:.6f} {:.6f} Td ({}) Tj ET\n", left,
                           y + 2.0 * kPointsPerMm, Caption(target));
  }
  // From here on millimetres, y downwards.
  content += fmt::format("{0:.10f} 0 0 -{0:.10f} 0 {1:.6f} cm\n", kPointsPerMm,
                         kPointsPerMm * sheet.height_mm);
  if (print.ground_lightness < 1.0) content += PdfShape(Ground(print), sheet);
  for (const PrintShape& shape : print.shapes) content += PdfShape(shape, sheet);
  return content;
}

/// One page. Ref: ISO 32000-1, 7.5 (file structure).
std::string Pdf(const CalibrationTarget& target, const TargetPrint& print, const Sheet& sheet) {
  const std::string content = PdfContent(target, print, sheet);
  const std::vector<std::string> objects = {
      "<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>",
      "<< /Type /Pages /Kids [3 0 R] /Count 1 >>",
      fmt::format("<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {:.6f} {:.6f}] /Contents 4 0 R "
                  "/Resources << /Font << /F1 5 0 R >> >> >>",
                  kPointsPerMm * sheet.width_mm, kPointsPerMm * sheet.height_mm),
      fmt::format("<< /Length {} >>\nstream\n{}endstream", content.size(), content),
      "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>"};
  std::string pdf = "%PDF-1.4\n";
  std::vector<std::size_t> offsets;
  for (std::size_t i = 0; i < objects.size(); ++i) {
    offsets.push_back(pdf.size());
    pdf += fmt::format("{} 0 obj\n{}\nendobj\n", i + 1, objects[i]);
  }
  const std::size_t table = pdf.size();
  pdf += fmt::format("xref\n0 {}\n0000000000 65535 f \n", objects.size() + 1);
  for (const std::size_t offset : offsets) pdf += fmt::format("{:010d} 00000 n \n", offset);
  pdf += fmt::format("trailer\n<< /Size {} /Root 1 0 R >>\nstartxref\n{}\n%%EOF\n",
                     objects.size() + 1, table);
  return pdf;
}

}  // namespace

std::vector<std::string> PaperNames() {
  std::vector<std::string> names;
  for (const NamedPaper& paper : kPapers) names.emplace_back(paper.name);
  return names;
}

Result<Paper> PaperFromName(const std::string& name) {
  for (const NamedPaper& paper : kPapers) {
    if (name == paper.name) return paper.paper;
  }
  Paper paper;
  char cross = 0;
  std::istringstream stream(name);
  stream >> paper.width_mm >> cross >> paper.height_mm;
  const bool is_read =
      stream && cross == 'x' && stream.peek() == std::istringstream::traits_type::eof();
  if (is_read && paper.width_mm >= 20.0 && paper.height_mm >= 20.0 && paper.width_mm <= 5000.0 &&
      paper.height_mm <= 5000.0) {
    return paper;
  }
  return Fail("paper '{}' must be one of {}, or WIDTHxHEIGHT in mm from 20 to 5000", name,
              fmt::join(PaperNames(), ", "));
}

Status DrawTarget(const CalibrationTarget& target, const Paper& paper, const std::string& path) {
  if (Status status = Validate(target, path); !status) return status;
  const std::string ending = std::filesystem::path(path).extension().string();
  if (ending != ".pdf" && ending != ".svg") {
    return Fail("{}: a target is drawn as .pdf or .svg, not '{}'", path, ending);
  }
  const TargetPrint print = MakeTargetPrint(target);
  const Result<Sheet> sheet = LayOut(print, paper, path);
  if (!sheet) return tl::unexpected<Error>(sheet.error());
  const std::string text =
      ending == ".pdf" ? Pdf(target, print, *sheet) : Svg(target, print, *sheet);
  return WriteAtomically(path, [&](std::ostream& stream) -> Status {
    stream << text;
    return {};
  });
}

}  // namespace fringe_fusion
