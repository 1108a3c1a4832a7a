#include "clients/calibrate/objects/evaluation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <numeric>
#include <opencv2/core.hpp>
#include <ostream>
#include <random>
#include <stdexcept>
#include <tuple>
#include <utility>
#include <vector>

#include "clients/calibrate/objects/teaching.hpp"
#include "clients/calibrate/offline/drawing.hpp"
#include "clients/common/depth_file.hpp"
#include "clients/perceive/recognition/taught_objects.hpp"
#include "clients/recording/read_recording.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/files/mcap_reader.hpp"

namespace dtact::objects {
namespace {

namespace fs = std::filesystem;
using Names = std::vector<std::string>;

struct Sample {
  std::size_t name = 0;   ///< Index.
  std::size_t group = 0;  ///< Its press, or its object where that has a folder.
  perceive::Network::Output output;
};
using Samples = std::vector<Sample>;

[[noreturn]] void refuse(const fs::path& path, const std::string& sentence) {
  throw std::runtime_error(path.string() + ": " + sentence);
}

/// The sorted names of files or folders, without the hidden ones that file managers and version
/// control leave.
Names entries(const fs::path& folder, bool folders) {
  if (!fs::is_directory(folder)) refuse(folder, "there is no such folder");
  Names names;
  for (const auto& entry : fs::directory_iterator(folder)) {
    const std::string name = entry.path().filename().string();
    if (entry.is_directory() == folders && !name.starts_with('.')) names.push_back(name);
  }
  std::ranges::sort(names);
  return names;
}

class Reader {
 public:
  explicit Reader(double mm_per_px) : mm_per_px_(mm_per_px) {}

  /// Adds what lies in the folder of a name. Returns the number of its presses and objects.
  std::size_t add(const fs::path& folder, std::size_t name) {
    name_ = name;
    const std::size_t before = group_;
    add_files(folder);
    for (const std::string& object : entries(folder, true)) {
      const std::size_t first = samples.size();
      const std::size_t group = group_;
      add_files(folder / object);
      for (std::size_t i = first; i < samples.size(); ++i) samples[i].group = group;
      group_ = group + (samples.size() > first ? 1U : 0U);
    }
    return group_ - before;
  }

  Samples samples;
  std::vector<std::string> warnings;  ///< Recordings that could be read in part.

 private:
  void add_files(const fs::path& folder) {
    for (const std::string& file : entries(folder, false)) {
      const std::string ending = fs::path(file).extension();
      if (ending == ".mcap") add_recording(folder / file);
      if (ending == ".npy") add_map(folder / file);
    }
  }

  /// False for a press that dtact-perceive names nothing in.
  bool add(const perceive::TouchMap& map) {
    if (!fault_of(map).empty()) return false;
    samples.push_back({name_, group_, network_.run(map)});
    return true;
  }

  void add_recording(const fs::path& file) {
    const mcap::Reader reader(file);
    bool depth = false;
    bool pressed = false;
    std::uint64_t next_ns = 0;
    recording::RecordingHandlers handlers;
    handlers.frame = [&](const v1::Frame& frame, std::uint64_t time_ns) {
      const bool in_contact = frame.contact().in_contact();
      if (frame.has_contact() && !in_contact && std::exchange(pressed, false)) ++group_;
      depth |= frame.has_depth();
      if (!in_contact || !frame.has_depth() || time_ns < next_ns) return true;
      next_ns = time_ns + 100'000'000;  // as dtact-perceive
      pressed |= add(touch_map_of(frame.depth()));
      return true;
    };
    try {
      recording::read_recording(reader, handlers);
    } catch (const std::runtime_error& e) {
      refuse(file, e.what());
    }
    if (!reader.damage().empty()) {
      warnings.push_back(fmt::format("{}: not all of it could be read ({}): the rest is used",
                                     file.string(), reader.damage()));
    }
    if (pressed) ++group_;
    if (!depth) refuse(file, "its frames have no depth: record the daemon, not dtact-perceive");
  }

  void add_map(const fs::path& file) {
    const cli::NpyArray array = cli::read_npy(file);
    if (array.shape.size() != 2) refuse(file, "is no depth map of rows and columns");
    if (!(mm_per_px_ > 0)) refuse(file, "has no scale: give --mm-per-px");
    perceive::DepthGrid grid{.width = static_cast<int>(array.shape[1]),
                             .height = static_cast<int>(array.shape[0]),
                             .full_width = static_cast<int>(array.shape[1]),
                             .full_height = static_cast<int>(array.shape[0]),
                             .mm_per_px = mm_per_px_,
                             .values = {}};
    std::vector<std::int16_t> values;
    values.reserve(array.values.size());
    for (const double mm : array.values) {
      const auto um = std::isnan(mm) ? grid.untrusted : std::clamp(1000 * mm, -32767.0, 32767.0);
      values.push_back(static_cast<std::int16_t>(std::lround(um)));
    }
    grid.values = values;
    if (add(perceive::touch_map(grid))) ++group_;
  }

  double mm_per_px_;
  perceive::Network network_;
  std::size_t name_ = 0;
  std::size_t group_ = 0;  ///< Of the next press.
};

/// The name of the nearest of the samples that are taught, of which there are some.
template <typename Taught>
std::size_t nearest_name(const Samples& samples, const Sample& sample, Taught taught) {
  std::size_t name = 0;
  double least = 3;
  for (std::size_t i = 0; i < samples.size(); ++i) {
    if (!taught(i)) continue;
    const double there = perceive::distance(samples[i].output.features, sample.output.features);
    if (there < least) std::tie(least, name) = std::tie(there, samples[i].name);
  }
  return name;
}

std::string share(std::size_t right, std::size_t all) {
  return fmt::format("{:.3f} of {}", static_cast<double>(right) / static_cast<double>(all), all);
}

/// When 70 % of all samples, drawn at random, are taught.
std::string right_by_frame(const Samples& samples) {
  std::vector<std::size_t> order(samples.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::shuffle(order.begin(), order.end(), std::mt19937(48));  // the same each time
  const std::size_t taught = samples.size() * 7 / 10;
  std::vector<char> is_taught(samples.size());
  for (std::size_t i = 0; i < taught; ++i) is_taught[order[i]] = 1;
  const auto right = std::count_if(
      order.begin() + static_cast<std::ptrdiff_t>(taught), order.end(), [&](std::size_t i) {
        return nearest_name(samples, samples[i],
                            [&](std::size_t k) { return is_taught[k] != 0; }) == samples[i].name;
      });
  return share(static_cast<std::size_t>(right), samples.size() - taught);
}

/// Rows: pressed; columns: named; percent of each row.
using Confusion = std::vector<std::vector<double>>;

std::string draw(const Confusion& table, const Names& names) {
  constexpr int kCell = 40;
  constexpr int kMargin = 14;
  constexpr int kTop = kMargin + 3 * ctl::kTextHeight;
  const std::string title = "% of a row named as a column";
  const auto ink = cv::Scalar::all(20);
  int left = 0;
  for (const std::string& name : names) {
    left = std::max(left, ctl::text_width(name + "  99") + 2 * kMargin);
  }
  const auto side = static_cast<int>(names.size()) * kCell + kMargin;
  const int width = std::max(left + side, ctl::text_width(title) + 2 * kMargin);
  ctl::Picture picture(kTop + side, width, ctl::Picture::value_type::all(255));
  const auto centred = [&](cv::Point corner, const std::string& text, const cv::Scalar& colour) {
    ctl::draw_text(picture, corner - cv::Point(ctl::text_width(text), ctl::kTextHeight) / 2, text,
                   colour);
  };
  ctl::draw_text(picture, {kMargin, kMargin}, title, ink);
  for (std::size_t row = 0; row < names.size(); ++row) {
    const int at = static_cast<int>(row) * kCell;
    const std::string label = fmt::format("{}  {}", names[row], row + 1);
    centred({left + at + kCell / 2, kTop - ctl::kTextHeight}, fmt::to_string(row + 1), ink);
    centred({left - kMargin - ctl::text_width(label) / 2, kTop + at + kCell / 2}, label, ink);
    for (std::size_t column = 0; column < names.size(); ++column) {
      const double percent = table[row][column];
      const cv::Rect cell(left + static_cast<int>(column) * kCell, kTop + at, kCell - 1, kCell - 1);
      picture(cell).setTo(
          cv::Scalar(247 - 2.3 * percent, 250 - 1.6 * percent, 255 - 0.8 * percent));
      if (percent < 0.5) continue;
      centred((cell.tl() + cell.br()) / 2, fmt::format("{:.0f}", percent),
              percent > 50 ? cv::Scalar::all(255) : ink);
    }
  }
  return image::encode_png(ctl::to_image(picture));
}

}  // namespace

void evaluate(const EvaluationPlan& plan, std::ostream& out) {
  const Names names = entries(plan.folder, true);
  if (names.size() < 2) {
    refuse(plan.folder, "two objects are needed at least, each a folder of .mcap or .npy files");
  }
  Reader reader(plan.mm_per_px);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::size_t groups = reader.add(fs::path(plan.folder) / names[i], i);
    if (groups < 2) {
      refuse(fs::path(plan.folder) / names[i],
             "two presses of 0.3 mm and more are needed, with most of the outline in the map");
    }
    out << fmt::format("{}: {} presses or objects\n", names[i], groups);
  }
  for (const std::string& warning : reader.warnings) out << "warning: " << warning << '\n';
  const Samples& samples = reader.samples;
  Confusion table(names.size(), std::vector<double>(names.size()));
  std::size_t right = 0;
  for (const Sample& sample : samples) {
    const std::size_t named = nearest_name(
        samples, sample, [&](std::size_t k) { return samples[k].group != sample.group; });
    ++table[sample.name][named];
    if (named == sample.name) ++right;
  }
  out << fmt::format(
      "frames named rightly by the nearest one that is taught:\n"
      "  by frame, 70 % taught at random, as in the paper: {}\n"
      "  by press and object, each left out, as a new press: {}\n",
      right_by_frame(samples), share(right, samples.size()));
  for (std::size_t row = 0; row < names.size(); ++row) {
    const double count = std::accumulate(table[row].begin(), table[row].end(), 0.0);
    for (double& cell : table[row]) cell *= 100 / count;
    out << fmt::format("{} is named", names[row]);
    for (std::size_t column = 0; column < names.size(); ++column) {
      if (table[row][column] < 0.5) continue;
      out << fmt::format(" {} {:.0f} %", names[column], table[row][column]);
    }
    out << '\n';
  }
  if (!plan.picture.empty()) base::write_file_atomically(plan.picture, draw(table, names));
}

}  // namespace dtact::objects
