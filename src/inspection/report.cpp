#include "fringe_fusion/inspection/report.hpp"

#include "fringe_fusion/io/file.hpp"

namespace fringe_fusion {
namespace {

constexpr const char* kStyle =
    "body{font-family:system-ui,sans-serif;max-width:64rem;margin:2rem auto;padding:0 1rem;"
    "color:#1c2430;line-height:1.5}"
    "h1{font-size:1.7rem;border-bottom:3px solid #2b6cb0;padding-bottom:.4rem}"
    "h2{font-size:1.15rem;margin:2rem 0 .5rem;color:#2b6cb0}"
    "table{border-collapse:collapse;width:100%;font-variant-numeric:tabular-nums}"
    "th,td{padding:.35rem .7rem;border-bottom:1px solid #dde3ea;text-align:right}"
    "th:first-child,td:first-child{text-align:left;white-space:nowrap}th{background:#f2f5f9}"
    ".pictures{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,24rem),1fr));"
    "gap:1.2rem;align-items:start}"
    "figure:last-child:nth-child(odd){grid-column:1/-1}"
    "figure{margin:0}figure img{width:100%;border:1px solid #dde3ea}"
    "figcaption{font-size:.9rem;color:#4a5668}";

std::string Escaped(const std::string& text) {
  std::string escaped;
  for (const char c : text) {
    switch (c) {
      case '&':
        escaped += "&amp;";
        break;
      case '<':
        escaped += "&lt;";
        break;
      case '>':
        escaped += "&gt;";
        break;
      case '"':
        escaped += "&quot;";
        break;
      case '\'':
        escaped += "&#39;";
        break;
      default:
        escaped += c;
    }
  }
  return escaped;
}

// File name as the path of a URL: a browser would take #, ? and % of a name as syntax.
std::string UrlEncoded(const std::string& file) {
  constexpr const char* kPlain =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_.~/";
  std::string url;
  for (const char c : file) {
    if (std::string(kPlain).find(c) != std::string::npos) {
      url += c;
    } else {
      url += fmt::format("%{:02X}", static_cast<unsigned char>(c));
    }
  }
  return url;
}

void WriteRow(std::ostream& page, const std::vector<std::string>& cells, const char* tag) {
  page << "<tr>";
  for (const std::string& cell : cells) {
    page << '<' << tag << '>' << Escaped(cell) << "</" << tag << '>';
  }
  page << "</tr>\n";
}

void WriteTable(std::ostream& page, const Report::Table& table) {
  page << "<h2>" << Escaped(table.title) << "</h2>\n<table>\n";
  if (!table.header.empty()) {
    page << "<thead>\n";
    WriteRow(page, table.header, "th");
    page << "</thead>\n";
  }
  page << "<tbody>\n";
  for (const std::vector<std::string>& row : table.rows) WriteRow(page, row, "td");
  page << "</tbody>\n</table>\n";
}

}  // namespace

Status WriteReport(const Report& report, const std::string& path) {
  return WriteAtomically(path, [&](std::ostream& page) -> Status {
    page << "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
         << "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
         << "<title>" << Escaped(report.title) << "</title>\n<style>" << kStyle
         << "</style>\n</head>\n<body>\n<h1>" << Escaped(report.title) << "</h1>\n";
    for (const std::string& paragraph : report.paragraphs) {
      page << "<p>" << Escaped(paragraph) << "</p>\n";
    }
    for (const Report::Table& table : report.tables) WriteTable(page, table);
    if (!report.pictures.empty()) page << "<h2>Pictures</h2>\n<div class=\"pictures\">\n";
    for (const Report::Picture& picture : report.pictures) {
      page << "<figure><img src=\"" << UrlEncoded(picture.file) << "\" alt=\""
           << Escaped(picture.caption) << "\"><figcaption>" << Escaped(picture.caption)
           << "</figcaption></figure>\n";
    }
    if (!report.pictures.empty()) page << "</div>\n";
    for (const Report::Table& table : report.details) WriteTable(page, table);
    page << "</body>\n</html>\n";
    return {};
  });
}

}  // namespace fringe_fusion
