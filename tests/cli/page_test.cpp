// The parts of report pages: escaped texts, frames of strips, differences that show something.
#include "cli/page.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>

#include "cli/difference.hpp"
#include "cli/progress.hpp"
#include "support/messages.hpp"
#include "support/page.hpp"
#include "support/temp_dir.hpp"

namespace page_test {

namespace {

using dpr::Image;
using dpr::test::contains;
using dpr::test::TempDir;

std::string written(const TempDir& folder, const dpr::cli::Page& page) {
  page.write(folder / "page.html");
  return folder.read("page.html");
}

}  // namespace

TEST_SUITE("unit") {
  TEST_CASE("page: what a user types is text, not HTML") {
    const TempDir folder;
    dpr::cli::Page page({"<b>", "dpr pose -o 'a&b'", "\"device\""});
    page.add_facts({{"<i>", "1 < 2"}});
    page.add_pictures({{"a\"b.png", "<u>", 4, 3}});
    const std::string html = written(folder, page);
    for (const char* part :
         {"&lt;b&gt;", "a&amp;b", "&quot;device&quot;", "&lt;i&gt;", "1 &lt; 2", "a&quot;b.png"})
      CHECK(contains(html, part));
    for (const char* part : {"<b>", "<i>", "<u>", "a&b"}) CHECK_FALSE(contains(html, part));
    CHECK(contains(html, "name=\"viewport\""));
  }

  TEST_CASE("page: frames of a strip lie at equal distances, large ones are made smaller") {
    const TempDir folder;
    const auto frames =
        dpr::cli::write_strip(folder / "s.png", {Image(6, 4), Image(6, 4), Image(6, 4)}, {"a", "b", "c"});
    REQUIRE(frames.size() == 3);
    CHECK(frames[0].position == 0);
    CHECK(frames[1].position == 0.5);
    CHECK(frames[2].position == 1);
    CHECK(frames[1].caption == "b");
    CHECK(dpr::read_image(folder / "s.png").width == 6 + 2 + 6 + 2 + 6);
    const auto large = dpr::cli::write_strip(folder / "l.png", {Image(960, 480)}, {""});
    CHECK(large[0].width == 480);
    CHECK(large[0].height == 240);
    CHECK(dpr::cli::write_strip(folder / "none.png", {}, {}).empty());
    CHECK_FALSE(std::filesystem::exists(folder / "none.png"));
  }

  TEST_CASE("page: a player without script shows every row") {
    const TempDir folder;
    dpr::cli::Page page({"t", "c", "d"});
    page.add_player({}, {{{"a.png", "first", 1, 1}}, {{"a.png", "second", 1, 1, 1}}});
    page.add_player({}, {});
    const std::string html = written(folder, page);
    CHECK(contains(html, "<details open>"));
    CHECK(contains(html, "first"));
    CHECK(contains(html, "second"));
    CHECK(contains(html, "max=\"1\""));
  }

  TEST_CASE("page: a player of one row counts no pictures") {
    const TempDir folder;
    dpr::cli::Page page({"t", "c", "d"});
    page.add_player({}, {{{"a.png", "first", 1, 1}}});
    CHECK(contains(written(folder, page), "<summary>The picture</summary>"));
  }

  TEST_CASE("page: a table wider than the page scrolls, without broken words") {
    const TempDir folder;
    dpr::cli::Page page({"t", "c", "d"});
    page.add_table({{"place"}, {"-0.0003132, 0.0005218"}});
    const std::string html = written(folder, page);
    CHECK(contains(html, "<div class=\"wide\"><table>"));
    CHECK(contains(html, "</table></div>"));
    CHECK(contains(html, ".wide { overflow-x: auto;"));
    CHECK(contains(html, ".wide td { white-space: nowrap; }"));
  }

  TEST_CASE("plot: a single value between two gaps is seen") {
    const TempDir folder;
    constexpr double k_none = std::numeric_limits<double>::quiet_NaN();
    const dpr::cli::Plot one{"x", {0, 1, 2}, {{"Loss", "loss", true, {{"loss", {k_none, 1, k_none}}}}}};
    if (!dpr::cli::plot(folder / "plot.png", one)) {
      MESSAGE("skipped: gnuplot is not installed");
      return;
    }
    const Image image = dpr::read_image(folder / "plot.png");
    const auto is_colored = [](const glm::vec4& p) { return p.g < 0.5F * p.b; };
    CHECK(std::ranges::count_if(image.pixels, is_colored) > 20);
  }

  TEST_CASE("page: a wipe is hidden without script, and says which picture is which") {
    const TempDir folder;
    dpr::cli::Page page({"t", "c", "d"});
    page.add_wipe({"a.png", "target", 4, 2}, {"b.png", "<end>", 4, 2});
    const std::string html = written(folder, page);
    CHECK(contains(html, "src=\"a.png\""));
    CHECK(contains(html, "src=\"b.png\""));
    CHECK(contains(html, "<p>Left: &lt;end&gt;. Right: target.</p>"));
    CHECK(contains(html, "<section class=\"wipe\" hidden>"));
  }

  TEST_CASE("page: the values of a plot lie beside it, and its texts are text") {
    const TempDir folder;
    dpr::cli::Page page({"t", "c", "d"});
    constexpr double k_none = std::numeric_limits<double>::quiet_NaN();
    page.add_plot("plot.png", "<curves>",
                  {"</script><b>",
                   {3, 5, 9},
                   {{"Loss", "loss", true, {{"loss", {0.1234567, 2e-9, k_none}}}},
                    {"Two", "y", false, {{"a", {1, 2, 3}}, {"b", {4, 5, 6}}}}}});
    const std::string html = written(folder, page);
    CHECK(contains(html, "src=\"plot.png\" alt=\"&lt;curves&gt;\""));
    CHECK_FALSE(contains(html, "<b>"));
    const std::string begin = "<script type=\"application/json\">";
    const std::size_t first = html.find(begin) + begin.size();
    const auto data = nlohmann::json::parse(html.substr(first, html.find("</script>", first) - first));
    CHECK(data["name"] == "</script><b>");
    CHECK(data["x"] == nlohmann::json{3, 5, 9});
    REQUIRE(data["curves"].size() == 3);
    CHECK(data["curves"][0]["y"] == nlohmann::json{0.12346, 2e-9, nullptr});
    CHECK(data["curves"][2]["name"] == "b");
    CHECK(data["curves"][2]["y"][2] == 6);
  }

  TEST_CASE("page: a plot of a single place is a picture alone") {
    const TempDir folder;
    dpr::cli::Page page({"t", "c", "d"});
    page.add_plot("one.png", "one", {"x", {1}, {{"Loss", "loss", true, {{"loss", {1}}}}}});
    page.add_plot("none.png", "none", {"x", {}, {}});
    const std::string html = written(folder, page);
    CHECK(contains(html, "src=\"one.png\""));
    CHECK(contains(html, "src=\"none.png\""));
    CHECK(dpr::test::count_of(html, "<script") == 1);
  }

  TEST_CASE("differences: the gain shows small ones, leaves large ones, and is said") {
    const auto grey = [](float value) { return Image(10, 10, glm::vec4(value, value, value, 1)); };
    const auto small = dpr::cli::differences({grey(0.5F)}, {grey(0.51F)});
    CHECK(small.gain == 8);  // the most
    CHECK(small.images[0].pixels[0].r == doctest::Approx(0.08));
    CHECK(small.caption() == "difference, 8 times as bright");
    CHECK(dpr::cli::differences({grey(0)}, {grey(1)}).gain == 1);
    CHECK(dpr::cli::differences({grey(0.5F)}, {grey(0.5F)}).caption() == "difference");
    Image spot = grey(0.5F);
    spot.pixels[7].g = 0.625F;
    CHECK(dpr::cli::differences({spot}, {grey(0.5F)}).gain == 4);
  }

  TEST_CASE("durations in a unit that suits them") {
    CHECK(dpr::cli::duration_text(12.2) == "12 s");
    CHECK(dpr::cli::duration_text(120) == "2 min");
    CHECK(dpr::cli::duration_text(7200) == "2.0 h");
  }
}

}  // namespace page_test
