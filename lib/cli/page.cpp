#include "cli/page.hpp"

#include <algorithm>
#include <cmath>
#include <ostream>

#include "base/output_file.hpp"
#include "cli/json.hpp"
#include "cli/page_script.hpp"
#include "cli/text.hpp"
#include "solve/resample.hpp"

namespace dpr::cli {
namespace {

std::string escaped(const std::string& text) {
  std::string html;
  for (const char c : text) {
    switch (c) {
      case '&':
        html += "&amp;";
        break;
      case '<':
        html += "&lt;";
        break;
      case '>':
        html += "&gt;";
        break;
      case '"':
        html += "&quot;";
        break;
      default:
        html += c;
    }
  }
  return html;
}

std::string figure(const Picture& picture) {
  constexpr int k_few_pixels = 256;  // enlarged, their pixels stay squares
  const char* const pixels =
      std::max(picture.width, picture.height) <= k_few_pixels ? "class=\"pixels\" " : "";
  const std::string caption = escaped(picture.caption);
  return "<figure><img " + std::string(pixels) + "src=\"" + escaped(picture.file) + "\" alt=\"" + caption +
         "\" style=\"" +
         format("aspect-ratio: %d/%d; object-position: %.6g%% 0", picture.width, picture.height,
                100 * picture.position) +
         "\"><figcaption>" + caption + "</figcaption></figure>\n";
}

std::string figures(const std::vector<Picture>& pictures) {
  std::string html;
  for (const Picture& picture : pictures) html += figure(picture);
  return html;
}

/// A number that is none becomes null.
Json short_number(double value) { return std::isfinite(value) ? Json::parse(format("%.5g", value)) : Json(); }

/// The values of a plot as the page's script reads them.
std::string plot_data(const Plot& plot) {
  Json curves = Json::array();
  for (const Panel& panel : plot.panels) {
    for (const Curve& curve : panel.curves) {
      Json y = Json::array();
      for (const double value : curve.y) y.push_back(short_number(value));
      curves.push_back({{"name", curve.title}, {"y", y}});
    }
  }
  return script_safe({{"name", plot.x_label},
                      {"x", plot.x},
                      {"left", k_plot_left},
                      {"right", k_plot_right},
                      {"curves", curves}});
}

}  // namespace

Image fitted(const Image& image, int longest) {
  const int side = std::max(image.width, image.height);
  if (side <= longest) return image;
  const auto scaled = [&](int length) { return std::max(1, length * longest / side); };
  return resample(image, scaled(image.width), scaled(image.height));
}

std::vector<Picture> write_strip(const std::filesystem::path& file, const std::vector<Image>& images,
                                 const std::vector<std::string>& captions) {
  if (images.empty()) return {};
  std::vector<Image> frames;
  std::vector<Picture> pictures;
  for (std::size_t i = 0; i < images.size(); ++i) {
    const Image& frame = frames.emplace_back(opaque(fitted(images[i])));
    const double last = static_cast<double>(images.size() - 1);
    pictures.push_back({file.filename().string(), captions[i], frame.width, frame.height,
                        i == 0 ? 0 : static_cast<double>(i) / last});
  }
  write_image(file, hstack(frames));
  return pictures;
}

Picture write_picture(const std::filesystem::path& file, const Image& image, const std::string& caption) {
  write_image(file, opaque(image));
  return {file.filename().string(), caption, image.width, image.height};
}

Page::Page(const PageSource& source) {
  const std::string title = escaped(source.title);
  html_ =
      "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
      "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n<title>" +
      title + "</title>\n" + std::string(page_style()) + "</head>\n<body>\n<h1>" + title +
      "</h1>\n<p class=\"source\"><code>" + escaped(source.command) + "</code><br>" + escaped(source.device) +
      "</p>\n";
}

void Page::add_heading(const std::string& text) { html_ += "<h2>" + escaped(text) + "</h2>\n"; }

void Page::add_paragraph(const std::string& text) { html_ += "<p>" + escaped(text) + "</p>\n"; }

void Page::add_row(const TableRow& row, const char* first, const char* others) {
  html_ += "<tr>";
  for (std::size_t i = 0; i < row.size(); ++i) {
    const std::string tag = i == 0 ? first : others;
    html_ += "<" + tag + ">" + escaped(row[i]) + "</" + tag + ">";
  }
  html_ += "</tr>\n";
}

void Page::add_facts(const std::vector<TableRow>& rows) {
  html_ += "<table>\n";
  for (const TableRow& row : rows) add_row(row, "th", "td");
  html_ += "</table>\n";
}

void Page::add_table(const std::vector<TableRow>& rows) {
  html_ += "<div class=\"wide\"><table>\n";
  for (const TableRow& row : rows) {
    const char* const tag = &row == &rows.front() ? "th" : "td";
    add_row(row, tag, tag);
  }
  html_ += "</table></div>\n";
}

void Page::add_pictures(const std::vector<Picture>& pictures) {
  html_ += "<div class=\"pictures\">\n" + figures(pictures) + "</div>\n";
}

void Page::add_player(const std::vector<Picture>& fixed, const std::vector<std::vector<Picture>>& rows) {
  if (rows.empty()) return;
  const std::size_t row = rows.front().size(), last = rows.size() - 1;
  const auto count = [](const char* name, std::size_t n) {
    return "style=\"--" + std::string(name) + ": " + std::to_string(n) + "\"";
  };
  html_ += "<section class=\"player\">\n<div class=\"stage\" " + count("stage", fixed.size() + row) +
           " hidden>\n" + figures(fixed) +
           "</div>\n<div class=\"controls\" hidden><button type=\"button\">Play</button>"
           "<input type=\"range\" aria-label=\"frame\" min=\"0\" value=\"0\" max=\"" +
           std::to_string(last) + "\"></div>\n<details open><summary>The " +
           (rows.size() == 1 ? "picture" : std::to_string(rows.size()) + " pictures") +
           "</summary>\n<div class=\"rows\" " + count("row", row) + ">\n";
  for (const std::vector<Picture>& pictures : rows)
    html_ += "<div class=\"row\">\n" + figures(pictures) + "</div>\n";
  html_ += "</div></details>\n</section>\n";
}

void Page::add_wipe(const Picture& first, const Picture& second) {
  html_ += "<section class=\"wipe\" hidden>\n<div class=\"pictures\">\n" + figures({first, second}) +
           "</div>\n<div class=\"controls\"><input type=\"range\" aria-label=\"percent that shows: " +
           escaped(second.caption) +
           "\" min=\"0\" max=\"100\" value=\"50\"></div>\n<p>Left: " + escaped(second.caption) +
           ". Right: " + escaped(first.caption) + ".</p>\n</section>\n";
}

void Page::add_plot(const std::string& file, const std::string& caption, int width) {
  html_ += "<p><img class=\"plot\" src=\"" + escaped(file) + "\" alt=\"" + escaped(caption) +
           "\" style=\"max-width: min(100%, " + std::to_string(width) + "px)\"></p>\n";
}

void Page::add_plot(const std::string& file, const std::string& caption, const Plot& plot) {
  constexpr int k_width = 640;
  const auto [low, high] = std::ranges::minmax_element(plot.x);
  if (plot.x.empty() || *low == *high) return add_plot(file, caption, k_width);
  html_ +=
      "<div class=\"curves\" style=\"max-width: " + std::to_string(k_width) +
      "px\">\n<div class=\"picture\" role=\"group\" aria-label=\"" + escaped(caption) + "\"><img src=\"" +
      escaped(file) + "\" alt=\"" + escaped(caption) +
      "\"><div class=\"place\" hidden></div></div>\n"
      "<p class=\"values\" aria-live=\"polite\" hidden>Point at the curves to read their values, or focus "
      "them and use the arrow keys.</p>\n<script type=\"application/json\">" +
      plot_data(plot) + "</script></div>\n";
}

void Page::add_model(const Model& model) {
  if (three_js().empty()) return;
  if (model.faces.size() > k_most_model_faces) {
    add_heading(model.heading);
    add_paragraph(format("A model to turn by hand is left out: it has %zu triangles, and a page at most %zu.",
                         model.faces.size(), k_most_model_faces));
    return;
  }
  has_models_ = true;
  constexpr double k_widest = 2, k_tallest = 0.75;
  const double aspect =
      std::clamp(static_cast<double>(model.start.width) / model.start.height, k_tallest, k_widest);
  html_ += "<section class=\"model\" hidden>\n";
  add_heading(model.heading);
  html_ +=
      "<p class=\"without\" hidden>This browser has no WebGL, which a model to turn by hand needs.</p>\n"
      "<figure><div class=\"view\" style=\"" +
      format("aspect-ratio: %.4g", aspect) + "\"><canvas tabindex=\"0\" role=\"img\" aria-label=\"" +
      escaped(model.heading) + ": arrow keys turn it, plus and minus zoom\"></canvas></div>\n<figcaption>" +
      escaped(model.caption) +
      " Drag to turn; the wheel or two fingers zoom, and so do the keys + and -, the arrow keys turn."
      "</figcaption>\n<button type=\"button\">First view</button></figure>\n"
      "<script type=\"application/json\">" +
      model_data(model) + "</script>\n</section>\n";
}

void Page::write(const std::filesystem::path& file) const {
  write_whole_file(file, [&](std::ostream& out) {
    out << html_ << page_script();
    if (has_models_) {
      out << "<script>\n// three.js, Copyright 2010-2019 three.js authors, under the MIT License\n"
          << three_js() << "\n</script>\n"
          << model_script();
    }
    out << "</body>\n</html>\n";
  });
}

}  // namespace dpr::cli
