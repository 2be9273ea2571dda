#include "cli/page.hpp"

#include <algorithm>
#include <ostream>

#include "base/output_file.hpp"
#include "cli/text.hpp"
#include "solve/resample.hpp"

namespace dpr::cli {
namespace {

constexpr const char* k_style = R"(<style>
:root { color-scheme: light dark; --text: #222; --page: #fff; --quiet: #555; --line: #ddd; --frame: #bbb; }
@media (prefers-color-scheme: dark) {
  :root { --text: #ddd; --page: #181818; --quiet: #aaa; --line: #444; --frame: #666; }
}
body { font-family: system-ui, sans-serif; line-height: 1.4; max-width: 62rem; margin: 1.5rem auto; padding: 0 1rem;
  color: var(--text); background: var(--page); }
h1 { line-height: 1.15; margin-bottom: 0.3em; }
h2 { margin-top: 1.8em; }
.source { color: var(--quiet); font-size: 90%; overflow-wrap: anywhere; }
figure { margin: 0; min-width: 0; }
figure img { display: block; width: 100%; object-fit: cover; box-sizing: border-box; border: 1px solid var(--frame); }
img.pixels { image-rendering: pixelated; }
figcaption { font-size: 85%; color: var(--quiet); padding-top: 0.2em; }
.pictures, .stage, .row { display: grid; gap: 0.8rem; align-items: start; }
.pictures, .stage { grid-template-columns: repeat(auto-fit, minmax(min(100%, 9.5rem), 1fr)); }
.stage { max-width: calc(20rem * var(--stage)); }
.rows { display: grid; gap: 0.8rem; margin-top: 0.6rem;
  grid-template-columns: repeat(auto-fill, minmax(min(100%, calc(6.5rem * var(--row))), 1fr)); }
.row { grid-template-columns: repeat(var(--row), minmax(0, 1fr)); gap: 0.3rem; }
.controls { display: flex; gap: 0.8rem; align-items: center; max-width: 40rem; margin: 0.6rem 0; }
.controls input { flex: 1; min-width: 0; height: 2rem; margin: 0; }
.controls button { font: inherit; padding: 0.4em 1em; min-width: 5.5em; }
.wipe { max-width: 25rem; margin-top: 1.2rem; }
.wipe .pictures { display: block; position: relative; }
.wipe figure + figure { position: absolute; inset: 0; }
.wipe figcaption { display: none; }
.plot { width: 100%; }
[hidden] { display: none; }
table { border-collapse: collapse; margin: 1em 0; }
td, th { padding: 0.2em 1em 0.2em 0; text-align: left; vertical-align: top; border-bottom: 1px solid var(--line);
  font-variant-numeric: tabular-nums; overflow-wrap: anywhere; }
th { font-weight: normal; color: var(--quiet); overflow-wrap: normal; }
</style>
)";

// The second picture of a wipe lies over the first, up to where the slider is. A row of the player's list is copied into
// its stage, and shown again whenever the slider moves.
constexpr const char* k_script = R"(<script>
for (const wipe of document.querySelectorAll('.wipe')) {
  const over = wipe.querySelector('figure + figure'), slider = wipe.querySelector('input');
  slider.oninput = () => { over.style.clipPath = 'inset(0 ' + (100 - slider.value) + '% 0 0)'; };
  slider.oninput();
  wipe.hidden = false;
}
for (const player of document.querySelectorAll('.player')) {
  const rows = [...player.querySelectorAll('.row')];
  const stage = player.querySelector('.stage'), controls = player.querySelector('.controls');
  const button = controls.querySelector('button'), slider = controls.querySelector('input');
  const screens = [...rows[0].children].map(figure => stage.appendChild(figure.cloneNode(true)));
  const show = () => {
    const figures = [...rows[slider.value].children];
    const caption = figure => figure.querySelector('figcaption').textContent;
    slider.ariaValueText = figures.map(caption).join(', ');
    screens.forEach((screen, i) => {
      const [to, from] = [screen, figures[i]].map(f => f.querySelector('img'));
      if (to.src !== from.src) to.src = from.src;
      to.style.cssText = from.style.cssText;
      to.alt = from.alt;
      screen.querySelector('figcaption').textContent = caption(figures[i]);
    });
  };
  let timer = 0;
  const stop = () => { clearInterval(timer); timer = 0; button.textContent = 'Play'; };
  const step = () => { slider.value = (Number(slider.value) + 1) % rows.length; show(); };
  button.onclick = () => {
    if (timer) return stop();
    timer = setInterval(step, 400);
    button.textContent = 'Pause';
    step();
  };
  slider.oninput = () => { stop(); show(); };
  show();
  stage.hidden = controls.hidden = false;
  player.querySelector('details').open = false;
}
</script>
)";

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

/// Small enough for strips that browsers show.
Image fitted(const Image& image) {
  constexpr int k_longest = 480;
  const int longest = std::max(image.width, image.height);
  if (longest <= k_longest) return image;
  const auto scaled = [&](int side) { return std::max(1, side * k_longest / longest); };
  return resample(image, scaled(image.width), scaled(image.height));
}

}  // namespace

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
      title + "</title>\n" + k_style + "</head>\n<body>\n<h1>" + title + "</h1>\n<p class=\"source\"><code>" +
      escaped(source.command) + "</code><br>" + escaped(source.device) + "</p>\n";
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
  html_ += "<table>\n";
  for (const TableRow& row : rows) {
    const char* const tag = &row == &rows.front() ? "th" : "td";
    add_row(row, tag, tag);
  }
  html_ += "</table>\n";
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
           std::to_string(last) + "\"></div>\n<details open><summary>The " + std::to_string(rows.size()) +
           " pictures</summary>\n<div class=\"rows\" " + count("row", row) + ">\n";
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

void Page::write(const std::filesystem::path& file) const {
  write_whole_file(file, [&](std::ostream& out) { out << html_ << k_script << "</body>\n</html>\n"; });
}

}  // namespace dpr::cli
