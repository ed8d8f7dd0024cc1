#include "nodes/scan_output.hpp"

#include <yaml-cpp/yaml.h>

#include "fringe_fusion/inspection/picture.hpp"
#include "fringe_fusion/inspection/report.hpp"
#include "fringe_fusion/io/config_yaml.hpp"
#include "fringe_fusion/io/file.hpp"
#include "fringe_fusion/io/image_io.hpp"
#include "fringe_fusion/io/mesh_io.hpp"
#include "fringe_fusion/io/poses_conf.hpp"
#include "fringe_fusion/ros_io/geometry_messages.hpp"

namespace fringe_fusion::nodes {
namespace {

/// job.yaml, read like any config.
struct JobFile {
  std::string scan_id;
  int num_views = 0;

  template <typename Visitor>
  void Visit(Visitor&& field) {
    field("scan_id", scan_id);
    field("num_views", num_views, 1, 100000);
  }
};

Status WriteText(const std::string& text, const std::string& path) {
  return WriteAtomically(path, [&](std::ostream& stream) -> Status {
    stream << text;
    return {};
  });
}

// A string as it stands in JSON and, nearly the same, in YAML.
std::string Quoted(const std::string& text) {
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') quoted += '\\';
    if (static_cast<unsigned char>(c) >= 0x20) quoted += c;
  }
  return quoted + '"';
}

std::string FindingsText(const ScanFigures::View& view) {
  std::string text;
  for (const ScanFigures::Finding& finding : view.findings) {
    text += fmt::format("{}{{\"name\": {}, \"evidence\": {}, \"advice\": {}}}",
                        text.empty() ? "" : ", ", Quoted(finding.name), Quoted(finding.evidence),
                        Quoted(finding.advice));
  }
  return text;
}

Report::Table CaptureTable(const ScanFigures& figures) {
  Report::Table table{"Capture", {"view", "finding", "evidence", "what to do"}, {}};
  for (const ScanFigures::View& view : figures.views) {
    const std::string name = fmt::format("{:03}", view.id);
    for (const ScanFigures::Finding& finding : view.findings) {
      table.rows.push_back({name, finding.name, finding.evidence, finding.advice});
    }
    if (view.findings.empty()) table.rows.push_back({name, "none", "", ""});
  }
  return table;
}

std::string Millimetres(double metres) { return fmt::format("{:.4f}", 1e3 * metres); }

}  // namespace

Status WriteJob(const ScanJob& job, const std::string& folder) {
  return WriteText(fmt::format("scan_id: {}\nnum_views: {}\n", Quoted(job.scan_id), job.num_views),
                   folder + "/job.yaml");
}

Result<ScanJob> ReadJob(const std::string& folder) {
  const Result<JobFile> file = LoadConfigFile<JobFile>(folder + "/job.yaml");
  if (!file) return Forward(file);
  return ScanJob{file->scan_id, file->num_views};
}

int ScanFigures::NumPoints() const {
  int total = 0;
  for (const View& view : views) total += view.num_points;
  return total;
}

int ScanFigures::NumDropped() const {
  int total = 0;
  for (const View& view : views) total += view.num_dropped;
  return total;
}

Status WritePoses(const std::map<int, Transform>& poses, const std::string& path) {
  std::vector<ConfEntry> entries;
  for (const auto& [id, T_object_camera] : poses) {
    entries.push_back({fmt::format("scan/views/{:03}/range.ply", id), T_object_camera});
  }
  return WritePosesConf(entries, path);
}

Result<std::map<int, Transform>> PosesOf(const ViewPoses& poses) {
  std::map<int, Transform> result;
  for (const ViewPose& view : poses.views) {
    const Result<Transform> T = ros_io::FromMessage(view.pose.pose);
    if (!T) return Fail("pose of view {}: {}", view.view_id, T.error().message);
    result[static_cast<int>(view.view_id)] = *T;
  }
  return result;
}

Status WriteFigures(const ScanFigures& figures, const std::string& path) {
  std::string text = "{\n";
  text += fmt::format("  \"scan_id\": {},\n", Quoted(figures.job.scan_id));
  text += fmt::format("  \"num_views\": {},\n", figures.views.size());
  text += fmt::format("  \"num_points\": {},\n", figures.NumPoints());
  text += fmt::format("  \"num_dropped\": {},\n", figures.NumDropped());
  text += fmt::format("  \"rms_before_m\": {},\n", figures.rms_before_m);
  text += fmt::format("  \"rms_after_m\": {},\n", figures.rms_after_m);
  text += fmt::format("  \"num_vertices\": {},\n", figures.num_vertices);
  text += fmt::format("  \"num_faces\": {},\n", figures.num_faces);
  std::string warnings;
  for (const std::string& warning : figures.warnings) {
    warnings += (warnings.empty() ? "" : ", ") + Quoted(warning);
  }
  text += fmt::format("  \"warnings\": [{}],\n", warnings);
  text += "  \"views\": [\n";
  for (std::size_t i = 0; i < figures.views.size(); ++i) {
    const ScanFigures::View& view = figures.views[i];
    text += fmt::format(
        "    {{\"id\": {}, \"num_points\": {}, \"num_dropped\": {}, \"overlap_ratio\": {}, "
        "\"rms_m\": {}, \"connected\": {}, \"findings\": [{}]}}{}\n",
        view.id, view.num_points, view.num_dropped, view.overlap_ratio, view.rms_m, view.connected,
        FindingsText(view), i + 1 < figures.views.size() ? "," : "");
  }
  text += "  ],\n  \"seconds\": {";
  for (std::size_t i = 0; i < figures.seconds.size(); ++i) {
    text += fmt::format("{}{}: {:.3f}", i > 0 ? ", " : "", Quoted(figures.seconds[i].first),
                        figures.seconds[i].second);
  }
  text += "}\n}\n";
  return WriteText(text, path);
}

Status WriteScanReport(const ScanFigures& figures, const std::string& folder) {
  const Result<Mesh> mesh = ReadMesh(folder + "/mesh.ply");
  if (!mesh) return tl::unexpected<Error>(mesh.error());
  const Result<Image<Rgb8>> picture =
      RenderMesh(*mesh, Eigen::Vector3f(0.6F, -0.6F, 0.5F), 800, 600, /*use_colors=*/false);
  if (!picture) return tl::unexpected<Error>(picture.error());
  if (Status status = WriteImage(*picture, folder + "/mesh.png"); !status) return status;

  Report report;
  report.title = fmt::format("Scan {}", figures.job.scan_id);
  report.pictures.push_back({"The mesh", "mesh.png"});
  Report::Table summary{"Summary", {"figure", "value"}, {}};
  summary.rows.push_back({"views", fmt::format("{}", figures.views.size())});
  summary.rows.push_back({"points", fmt::format("{}", figures.NumPoints())});
  summary.rows.push_back({"points left out by the crop", fmt::format("{}", figures.NumDropped())});
  summary.rows.push_back(
      {"vertices, faces", fmt::format("{}, {}", figures.num_vertices, figures.num_faces)});
  summary.rows.push_back(
      {"registration rms before, after [mm]",
       Millimetres(figures.rms_before_m) + ", " + Millimetres(figures.rms_after_m)});
  report.tables.push_back(summary);
  if (!figures.warnings.empty()) {
    Report::Table warnings{"Registration: what to look at", {"warning"}, {}};
    for (const std::string& warning : figures.warnings) warnings.rows.push_back({warning});
    report.tables.push_back(warnings);
  }
  Report::Table views{"Views", {"view", "points", "left out", "overlap", "rms [mm]"}, {}};
  for (const ScanFigures::View& view : figures.views) {
    views.rows.push_back({fmt::format("{:03}", view.id), fmt::format("{}", view.num_points),
                          fmt::format("{}", view.num_dropped),
                          fmt::format("{:.0f} %", 100.0 * view.overlap_ratio),
                          view.connected ? Millimetres(view.rms_m) : "no overlap, prior kept"});
  }
  report.tables.push_back(views);
  report.tables.push_back(CaptureTable(figures));
  Report::Table seconds{"Time", {"stage", "s"}, {}};
  for (const auto& [stage, value] : figures.seconds) {
    seconds.rows.push_back({stage, fmt::format("{:.2f}", value)});
  }
  report.tables.push_back(seconds);
  return WriteReport(report, folder + "/report.html");
}

}  // namespace fringe_fusion::nodes
