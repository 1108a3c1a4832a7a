#include "clients/calibrate/offline/import_folder.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <sstream>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "clients/common/depth_file.hpp"
#include "hal/base/atomic_file.hpp"

namespace dtact::ctl {
namespace {

namespace fs = std::filesystem;

constexpr const char* kBoardFolder = "camera_calibration";
constexpr const char* kBallFolder = "depth_calibration";
constexpr const char* kDepthTable = "Pixel_to_Depth.npy";

[[noreturn]] void fail(const fs::path& file, const std::string& sentence) {
  throw std::runtime_error(fmt::format("{}: {}", file.string(), sentence));
}

bool has_layout(const fs::path& folder) {
  return fs::is_directory(folder / kBoardFolder) || fs::is_directory(folder / kBallFolder);
}

/// The folders below that would do.
std::vector<std::string> sensors_below(const fs::path& folder) {
  std::vector<std::string> names;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.is_directory() && has_layout(entry.path())) names.push_back(entry.path().string());
  }
  std::ranges::sort(names);
  return names;
}

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlanks = " \t\r";
  const auto first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return {};
  text = text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
  const bool quoted =
      text.size() >= 2 && text.front() == text.back() && (text[0] == '"' || text[0] == '\'');
  return quoted ? text.substr(1, text.size() - 2) : text;
}

std::string_view without_comment(std::string_view line) {
  for (std::size_t i = 0; i < line.size(); ++i) {
    if (line[i] == '#' && (i == 0 || line[i - 1] == ' ' || line[i - 1] == '\t')) {
      return line.substr(0, i);
    }
  }
  return line;
}

/// A key of a YAML file with its value or its list of values; headings have none.
struct Entry {
  std::string key;
  std::vector<std::string> values;
  int line = 0;
};

/// The part of YAML that such files use: "key: value", "key: [a, b]" and "key:" above "- a".
std::vector<Entry> entries_of(const fs::path& file) {
  std::istringstream text(base::read_text_file(file, 1U << 20U));
  std::vector<Entry> entries;
  std::string line;
  for (int number = 1; std::getline(text, line); ++number) {
    const std::string_view content = trimmed(without_comment(line));
    if (content.starts_with("- ")) {
      if (!entries.empty()) entries.back().values.emplace_back(trimmed(content.substr(2)));
      continue;
    }
    const std::size_t colon = content.find(':');
    if (colon == std::string_view::npos) continue;
    Entry& entry = entries.emplace_back();
    entry.key = trimmed(content.substr(0, colon));
    entry.line = number;
    std::string_view value = trimmed(content.substr(colon + 1));
    if (value.starts_with('[') && value.ends_with(']')) {
      value = value.substr(1, value.size() - 2);
      for (std::size_t comma = value.find(','); comma != std::string_view::npos;
           comma = value.find(',')) {
        entry.values.emplace_back(trimmed(value.substr(0, comma)));
        value = value.substr(comma + 1);
      }
      entry.values.emplace_back(trimmed(value));
    } else if (!value.empty()) {
      entry.values.emplace_back(value);
    }
  }
  return entries;
}

/// What a key may say.
struct Allowed {
  const char* key;
  std::size_t values;
  double low;
  double high;
  bool whole;
};

double number_of(const fs::path& file, const Entry& entry, const Allowed& allowed,
                 std::size_t index) {
  const std::string shown = fmt::format("{}", fmt::join(entry.values, ", "));
  double value = NAN;
  if (entry.values.size() == allowed.values) {
    const std::string& text = entry.values[index];
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{} || end != text.data() + text.size()) value = NAN;
  }
  if (value >= allowed.low && value <= allowed.high &&
      (!allowed.whole || value == std::floor(value))) {
    return value;
  }
  throw std::runtime_error(
      fmt::format("{}:{}: {}: \"{}\" is not allowed; expected {} from {:g} to {:g}", file.string(),
                  entry.line, allowed.key, shown,
                  allowed.values == 1 ? (allowed.whole ? "a whole number" : "a number")
                                      : "width and height, whole numbers",
                  allowed.low, allowed.high));
}

}  // namespace

ImportPictures find_pictures(const fs::path& folder) {
  if (!fs::is_directory(folder)) fail(folder, "no such folder");
  const fs::path board = folder / kBoardFolder;
  const fs::path ball = folder / kBallFolder;
  ImportPictures found{board / "ref.png", board / "sample.png", ball / "ref.png",
                       ball / "sample.png", ball / kDepthTable};
  if (!has_layout(folder)) {
    found = {folder / "board_reference.png", folder / "board.png", folder / "ball_reference.png",
             folder / "ball.png", folder / kDepthTable};
  }
  std::vector<std::string> missing;
  for (const fs::path& file :
       {found.board_reference, found.board, found.ball_reference, found.ball}) {
    if (!fs::is_regular_file(file)) missing.push_back(file.string());
  }
  if (missing.empty()) return found;
  if (!has_layout(folder) && missing.size() == 4) {
    if (const auto below = sensors_below(folder); !below.empty()) {
      fail(folder, fmt::format("holds the folders of several sensors; give one: {}",
                               fmt::join(below, ", ")));
    }
    fail(folder,
         fmt::format("is no calibration folder: it has neither {0}/ref.png, {0}/sample.png, "
                     "{1}/ref.png and {1}/sample.png nor board_reference.png, board.png, "
                     "ball_reference.png and ball.png",
                     kBoardFolder, kBallFolder));
  }
  std::string what_can_be_made;
  if (fs::is_regular_file(found.board_reference) && fs::is_regular_file(found.board)) {
    what_can_be_made = fmt::format(
        "; the lens alone is made by dtact-calibrate lens --board-reference {} --board "
        "{} -o lens.toml",
        found.board_reference.string(), found.board.string());
  }
  throw std::runtime_error(fmt::format(
      "{} missing: {}; needed are the undeformed surface and the pressed one, of the board of pins "
      "and of the ball{}",
      missing.size() == 1 ? "a picture is" : "pictures are", fmt::join(missing, ", "),
      what_can_be_made));
}

void read_shape_config(const fs::path& file, ImportSettings& settings) {
  const auto entries = entries_of(file);
  const auto take = [&](const Allowed& allowed, const auto& use) {
    const Entry* first = nullptr;
    for (const Entry& entry : entries) {
      if (entry.key != allowed.key) continue;
      if (first != nullptr) {
        throw std::runtime_error(
            fmt::format("{}:{}: {} stands in line {} already; keep one of them", file.string(),
                        entry.line, allowed.key, first->line));
      }
      first = &entry;
      for (std::size_t i = 0; i < allowed.values; ++i) {
        use(i, Stated{number_of(file, entry, allowed, i),
                      fmt::format("{}:{}", file.filename().string(), entry.line)});
      }
    }
  };
  const auto take_one = [&](const Allowed& allowed, Stated& stated) {
    take(allowed, [&](std::size_t, const Stated& value) { stated = value; });
  };
  take_one({"row_points", 1, 2, 100, true}, settings.rows);
  take_one({"col_points", 1, 2, 100, true}, settings.cols);
  take_one({"grid_distance", 1, 0.1, 100, false}, settings.pitch_mm);
  take_one({"BallRad", 1, 0.2, 99, false}, settings.radius_mm);
  take_one({"fps", 1, 0.1, 1000, false}, settings.fps);
  take({"resolution", 2, 16, 8192, true}, [&](std::size_t i, const Stated& value) {
    (i == 0 ? settings.width : settings.height) = value;
  });
}

std::vector<double> read_depth_table(const fs::path& file) {
  cli::NpyArray table = cli::read_npy(file);
  constexpr double kMaxMm = 16;
  if (table.shape.size() != 1 || table.values.size() < 3 || table.values.size() > 256 ||
      !std::ranges::all_of(table.values, [](double mm) { return std::abs(mm) < kMaxMm; })) {
    fail(file, "is no row of 3 to 256 depths in millimetres");
  }
  return std::move(table.values);
}

}  // namespace dtact::ctl
