// The HTML pages of the reports. A page refers to the pictures beside it and to nothing else: it opens
// without a network, on a phone too, and without its script it shows the same pictures.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "cli/page_model.hpp"
#include "cli/plot.hpp"
#include "dpr/image.hpp"

namespace dpr::cli {

/// Origin of a page.
struct PageSource {
  std::string title, command, device;
};

/// A picture of a page: a file, or one frame of a strip.
struct Picture {
  std::string file, caption;
  int width = 0, height = 0;  ///< pixels
  double position = 0;        ///< of the frame in its strip: 0 at the left end, 1 at the right end
};

/// At most that many pixels long; 480 are small enough for strips that browsers show.
Image fitted(const Image& image, int longest = 480);
/// Writes images of one size side by side into a file, each at most 480 pixels long; no file for no images.
/// The frames, with their captions, as many as images. Throws IoError.
std::vector<Picture> write_strip(const std::filesystem::path& file, const std::vector<Image>& images,
                                 const std::vector<std::string>& captions);
/// One image, its alpha left out. Throws IoError.
Picture write_picture(const std::filesystem::path& file, const Image& image, const std::string& caption);

using TableRow = std::vector<std::string>;

/// A page while it is written. Texts are plain: the page escapes them.
class Page {
 public:
  /// The heading, and what made the page.
  explicit Page(const PageSource& source);

  void add_heading(const std::string& text);
  void add_paragraph(const std::string& text);
  /// Names of values beside them.
  void add_facts(const std::vector<TableRow>& rows);
  /// The first row names the columns. A table wider than the page scrolls sideways.
  void add_table(const std::vector<TableRow>& rows);
  /// Beside each other, as the width allows.
  void add_pictures(const std::vector<Picture>& pictures);
  /// Two pictures of one size on one another, the second up to where a slider is; nothing without script.
  void add_wipe(const Picture& first, const Picture& second);
  /// A slider, and a button that plays. Each row is what is seen at once, beside `fixed`, which always is.
  /// Without script all rows are shown. All rows have as many pictures; nothing is added for none.
  void add_player(const std::vector<Picture>& fixed, const std::vector<std::vector<Picture>>& rows);
  /// At most `width` CSS pixels wide; 640 suit what plot() draws.
  void add_plot(const std::string& file, const std::string& caption, int width = 640);
  /// What plot() drew of these values, which are read where one points at the curves.
  void add_plot(const std::string& file, const std::string& caption, const Plot& plot);
  /// With its heading; nothing without script. Too large a model is left out, and the page says so. Does nothing where
  /// the command was built without three.js.
  void add_model(const Model& model);

  /// Throws IoError.
  void write(const std::filesystem::path& file) const;

 private:
  void add_row(const TableRow& row, const char* first, const char* others);

  std::string html_;
  bool has_models_ = false;
};

}  // namespace dpr::cli
