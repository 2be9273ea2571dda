#include "cli/page.hpp"

namespace dpr::cli {
namespace {

constexpr const char* k_style = R"(<style>
body { font-family: sans-serif; max-width: 62em; margin: 2em auto; padding: 0 1em; color: #222; }
figure { display: inline-block; margin: 0 1em 1em 0; }
figure img { width: 14em; image-rendering: pixelated; border: 1px solid #bbb; }
figcaption { font-size: 90%; color: #555; }
img.wide { max-width: 100%; }
table { border-collapse: collapse; margin-bottom: 1.5em; }
td, th { padding: 0.2em 1em 0.2em 0; text-align: left; border-bottom: 1px solid #ddd; }
</style>
)";

}  // namespace

void write_page_head(std::ostream& out, const std::string& title) {
  out << "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<title>" << title
      << "</title>\n"
      << k_style << "</head>\n<body>\n<h1>" << title << "</h1>\n";
}

void write_page_end(std::ostream& out) { out << "</body>\n</html>\n"; }

void write_row(std::ostream& out, const char* name, const std::string& value) {
  out << "<tr><th>" << name << "</th><td>" << value << "</td></tr>\n";
}

void write_picture(std::ostream& out, const char* file, const char* caption) {
  out << "<figure><img src=\"" << file << "\" alt=\"" << caption << "\"><figcaption>" << caption
      << "</figcaption></figure>\n";
}

void write_wide_picture(std::ostream& out, const char* file, const char* caption) {
  out << "<p><img class=\"wide\" src=\"" << file << "\" alt=\"" << caption << "\"></p>\n";
}

}  // namespace dpr::cli
