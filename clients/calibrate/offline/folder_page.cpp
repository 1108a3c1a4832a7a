#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "clients/calibrate/offline/board_images.hpp"
#include "clients/calibrate/offline/depth_file.hpp"
#include "clients/calibrate/offline/drawing.hpp"
#include "clients/calibrate/offline/folder_evaluation.hpp"
#include "hal/base/atomic_folder.hpp"

namespace dtact::ctl {
namespace {

constexpr Colour kFound{230, 60, 30};
constexpr Colour kIdeal{30, 140, 250};
constexpr Colour kPaper{255, 255, 255};

void cross(image::Rgb8& image, recon::Point at, int arm, Colour colour) {
  const auto x = static_cast<int>(std::lround(at.x));
  const auto y = static_cast<int>(std::lround(at.y));
  fill(image, x - arm, y, 2 * arm + 1, 1, colour);
  fill(image, x, y - arm, 1, 2 * arm + 1, colour);
}

/// A dotted line.
void line(image::Rgb8& image, recon::Point from, recon::Point to, Colour colour) {
  const double length = std::hypot(to.x - from.x, to.y - from.y);
  for (double s = 0; s <= length; s += 0.5) {
    const double part = length > 0 ? s / length : 0;
    fill(image, static_cast<int>(std::lround(std::lerp(from.x, to.x, part))),
         static_cast<int>(std::lround(std::lerp(from.y, to.y, part))), 1, 1, colour);
  }
}

/// Darkening as grey: black least, white most, the outermost two parts in a thousand cut off.
image::Rgb8 grey_of(int width, int height, const std::vector<float>& levels) {
  std::vector<float> sorted;
  std::ranges::copy_if(levels, std::back_inserter(sorted), [](float v) { return !std::isnan(v); });
  std::ranges::sort(sorted);
  const std::size_t cut = sorted.size() / 500;
  const float low = sorted.empty() ? 0 : sorted[cut];
  const float high = sorted.empty() ? 1 : sorted[sorted.size() - 1 - cut];
  image::Rgb8 image = canvas(width, height, kPaper);
  for (int y = 0, i = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x, ++i) {
      const float level = levels[static_cast<std::size_t>(i)];
      if (std::isnan(level)) continue;
      const auto grey = static_cast<std::uint8_t>(
          std::lround(230 * std::clamp((level - low) / std::max(high - low, 1e-3F), 0.F, 1.F)));
      fill(image, x, y, 1, 1, {grey, grey, grey});
    }
  }
  return image;
}

/// The camera's view of the board with the pins found and, twenty times as long, how far each is
/// from where the lens through all others expects it.
std::string pins_png(const FolderEvaluation& e) {
  constexpr double kLonger = 20;
  const cv::Mat1f levels(mean_levels(e.board_reference) - mean_levels(e.board));
  image::Rgb8 image = grey_of(levels.cols, levels.rows, {levels.begin(), levels.end()});
  for (std::size_t i = 0; i < e.pins->marks.size(); ++i) {
    const recon::Point px = e.pins->marks[i].px;
    const recon::Point residual = e.pins->lens.left_out[i];
    const double scale = kLonger / recon::central_mm_per_px(e.pins->lens.lens);
    cross(image, px, 5, kFound);
    line(image, px, {px.x + scale * residual.x, px.y + scale * residual.y}, kIdeal);
  }
  return image::encode_png(image);
}

/// The board as the lens rectifies it, with the ideal grid.
std::string grid_png(const FolderEvaluation& e) {
  const cv::Mat1f levels(mean_levels(e.board_reference) - mean_levels(e.board));
  const recon::Lens& lens = e.pins->lens.lens;
  const recon::MapPlace place{0, 0, levels.cols, levels.rows, recon::central_mm_per_px(lens)};
  std::vector<std::uint8_t> outside;
  const recon::RectifyTable table = make_lens_table(lens, levels.cols, levels.rows, place, outside);
  std::vector<float> rectified;
  for (std::size_t i = 0; i < outside.size(); ++i) {
    const recon::RectifyTable::Entry& at = table.entries[i];
    rectified.push_back(outside[i] != 0
                            ? std::numeric_limits<float>::quiet_NaN()
                            : levels(at.y + (at.fy + 64) / 128, at.x + (at.fx + 64) / 128));
  }
  image::Rgb8 image = grey_of(place.width, place.height, rectified);
  const recon::Point corner = surface_point(lens, place, 0, 0);
  for (const Mark& mark : e.pins->marks) {
    cross(image,
          {(mark.mm.x - corner.x) / place.mm_per_px, (mark.mm.y - corner.y) / place.mm_per_px}, 7,
          kIdeal);
  }
  return image::encode_png(image);
}

std::string depth_png(const FolderEvaluation& e, const ImageSet& reference, const ImageSet& press) {
  const recon::Model& model = *e.calibration->model;
  std::vector<float> mm =
      calibration::mean_depth_um(model, reference.mean_q8().pixels, press.frames());
  for (float& value : mm) value *= 0.001F;
  return encode_colour_png({model.rectify.width, model.rectify.height, model.mm_per_px, mm});
}

struct Picture {
  const char* file;
  const char* caption;
};
constexpr std::array<Picture, 4> kPictures{{
    {"pins.png",
     "The camera's view of the board: darkening, the pins found (red) and, twenty times as long, "
     "how "
     "far each lies from where the lens through all the others expects it (blue)."},
    {"grid.png",
     "The board rectified, with the ideal grid (blue). White: the camera does not see it."},
    {"ball.png", "Depth of the ball. Grey: untrusted."},
    {"board.png", "Depth of the board. Grey: untrusted."},
}};

std::string escaped(const std::string& text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '&':
        out += "&amp;";
        break;
      default:
        out += c;
    }
  }
  return out;
}

}  // namespace

void write_page(const FolderEvaluation& e, const std::string& name,
                const std::filesystem::path& folder) {
  base::FolderFiles files;
  if (e.pins) {
    files.emplace_back("pins.png", pins_png(e));
    files.emplace_back("grid.png", grid_png(e));
  }
  if (e.ball) files.emplace_back("ball.png", depth_png(e, e.ball_reference, e.ball_images));
  if (e.pin_depths) files.emplace_back("board.png", depth_png(e, e.board_reference, e.board));
  std::string html = fmt::format(
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{0}</title>\n"
      "<style>body{{font-family:sans-serif;max-width:60em;margin:2em auto;padding:0 1em}}"
      "img{{max-width:100%}}figure{{margin:2em 0}}</style></head>\n<body><h1>{0}</h1>\n<ul>\n",
      escaped(name));
  for (const std::string& text : lines_of(e)) html += fmt::format("<li>{}</li>\n", escaped(text));
  html += "</ul>\n";
  std::vector<std::string> known{"index.html"};
  for (const Picture& picture : kPictures) {
    known.emplace_back(picture.file);
    if (std::ranges::none_of(files, [&](const auto& f) { return f.first == picture.file; }))
      continue;
    html += fmt::format("<figure><img src=\"{}\" alt=\"\"><figcaption>{}</figcaption></figure>\n",
                        picture.file, picture.caption);
  }
  files.emplace_back("index.html", html + "</body></html>\n");
  base::write_folder_atomically(folder, files, known, "an evaluation's page");
}

}  // namespace dtact::ctl
