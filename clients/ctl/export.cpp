#include "clients/ctl/export.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>

#include <cerrno>
#include <charconv>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <optional>
#include <ostream>
#include <regex>
#include <stdexcept>
#include <string>
#include <string_view>
#include <system_error>
#include <utility>
#include <vector>

#include "clients/common/depth_file.hpp"
#include "clients/common/depth_message.hpp"
#include "clients/common/interruptible.hpp"
#include "clients/common/json.hpp"
#include "clients/common/reports.pb.h"
#include "clients/cpp/maps.hpp"
#include "clients/cpp/names.hpp"
#include "clients/recording/read_recording.hpp"
#include "hal/base/unique_fd.hpp"

namespace dtact::ctl {
namespace {

namespace fs = std::filesystem;

/// Frames of the recording by their place in it, from 0: [first, last).
struct Range {
  std::uint64_t first = 0;
  std::uint64_t last = std::numeric_limits<std::uint64_t>::max();
};

struct ExportOptions {
  std::string recording;
  std::string format;
  std::string output;
  std::string frames;
  bool force = false;
};

/// "3:10", "3:", ":10", "7".
std::optional<Range> parse_range(const std::string& text) {
  const auto number = [](std::string_view digits, std::uint64_t fallback) {
    if (digits.empty()) return std::optional(fallback);
    std::uint64_t value = 0;
    const auto [stop, error] = std::from_chars(digits.data(), digits.data() + digits.size(), value);
    return error == std::errc() && stop == digits.data() + digits.size() ? std::optional(value)
                                                                         : std::nullopt;
  };
  if (text.empty()) return std::nullopt;
  const std::size_t colon = text.find(':');
  const auto first = number(std::string_view(text).substr(0, colon), 0);
  if (!first) return std::nullopt;
  if (colon == std::string::npos) return Range{*first, *first + 1};
  const auto last =
      number(std::string_view(text).substr(colon + 1), std::numeric_limits<std::uint64_t>::max());
  if (!last || *last <= *first) return std::nullopt;
  return Range{*first, *last};
}

/// A file that is written piece by piece. Throws std::runtime_error with its name.
class Output {
 public:
  explicit Output(fs::path path) : path_(std::move(path)), stream_(path_, std::ios::binary) {
    check();
  }
  void write(std::string_view bytes) {
    stream_.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    check();
  }
  void rewind() { stream_.seekp(0); }
  void close() {
    stream_.close();
    check();
  }

 private:
  void check() const {
    if (!stream_) throw std::runtime_error(path_.string() + ": cannot be written (disk full?)");
  }
  fs::path path_;
  std::ofstream stream_;
};

/// All maps as one array of (maps, rows, columns).
class Stack {
 public:
  /// The head comes in finish(), so that NumPy refuses a file that is not whole.
  explicit Stack(const fs::path& path) : output_(path) {
    output_.write(std::string(head().size(), '\0'));
  }
  void add(const cli::DepthImage& depth, std::uint64_t frame) {
    if (maps_ > 0 && (depth.width != width_ || depth.height != height_)) {
      throw std::runtime_error(
          fmt::format("frame {} is {}x{} pixels and those before {}x{}: export them apart by "
                      "--frames",
                      frame, depth.width, depth.height, width_, height_));
    }
    width_ = depth.width;
    height_ = depth.height;
    ++maps_;
    output_.write(cli::npy_values(depth.mm));
  }
  void finish() {
    output_.rewind();
    output_.write(head());
    output_.close();
  }

 private:
  [[nodiscard]] std::string head() const {
    return cli::npy_head(fmt::format("({}, {}, {})", maps_, height_, width_));
  }
  Output output_;
  std::uint64_t maps_ = 0;
  int width_ = 0;
  int height_ = 0;
};

constexpr const char* kFrameColumns =
    "frame,sequence,time_ns,monotonic_ns,in_contact,area_mm2,x_mm,y_mm,deepest_mm,deepest_x_mm,"
    "deepest_y_mm,volume_mm3,force_n,force_uncertainty_n,brightness,calibration,health,map\n";

/// What was not measured is empty.
std::string line_of(const v1::Frame& frame, std::uint64_t index, std::uint64_t time,
                    const std::string& map) {
  std::string contact = ",,,,,,,,,";
  if (frame.has_contact()) {
    const v1::Contact& c = frame.contact();
    contact = fmt::format("{},{},{},{},{},{},{},{},{},{}", c.in_contact() ? 1 : 0, c.area_mm2(),
                          c.x_mm(), c.y_mm(), c.deepest_mm(), c.deepest_x_mm(), c.deepest_y_mm(),
                          c.volume_mm3(), c.has_force_n() ? fmt::to_string(c.force_n()) : "",
                          c.has_force_n() ? fmt::to_string(c.force_uncertainty_n()) : "");
  }
  return fmt::format("{},{},{},{},{},{},{},{},{}\n", index, frame.sequence(), time,
                     frame.monotonic_ns(), contact, frame.light().brightness(),
                     frame.has_calibration() ? std::to_string(frame.calibration()) : "",
                     fmt::join(client::names_of(frame.health()), " "), map);
}

/// A text as one field (RFC 4180): a recording may hold any.
std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string field = "\"";
  for (const char c : text) field += c == '"' ? std::string("\"\"") : std::string(1, c);
  return field + '"';
}

constexpr const char* kEventColumns = "time_ns,sequence,monotonic_ns,event,detail\n";

std::string line_of(const v1::Event& event, std::uint64_t time) {
  std::string detail;
  std::string what = "unknown";
  switch (event.what_case()) {
    case v1::Event::kContact:
      what = event.contact().contact().in_contact() ? "contact_made" : "contact_lost";
      detail = fmt::format("deepest_mm={}", event.contact().contact().deepest_mm());
      break;
    case v1::Event::kLight:
      what = "light";
      detail = fmt::format("brightness={}", event.light().brightness());
      break;
    case v1::Event::kReference:
      what = "reference";
      detail = event.reference().restored() ? "restored" : "taken";
      break;
    case v1::Event::kState:
      what = "state";
      detail = client::name_of(event.state().state());
      break;
    case v1::Event::kCalibration:
      what = "calibration";
      detail = event.calibration().name();
      break;
    case v1::Event::kReconstruction:
      what = "reconstruction";
      detail = fmt::format("resolution={} sharpen={} max_error_um={}",
                           event.reconstruction().resolution(), event.reconstruction().sharpen(),
                           event.reconstruction().max_error_um());
      break;
    case v1::Event::WHAT_NOT_SET:
      break;
  }
  return fmt::format("{},{},{},{},{}\n", time, event.sequence(), event.monotonic_ns(), what,
                     csv_field(detail));
}

/// Writes the frames of a recording into a folder.
class Exporter {
 public:
  Exporter(const ExportOptions& options, fs::path folder)
      : options_(options),
        folder_(std::move(folder)),
        range_(parse_range(options.frames).value_or(Range{})),
        frames_(folder_ / "frames.csv"),
        events_(folder_ / "events.csv") {
    frames_.write(kFrameColumns);
    events_.write(kEventColumns);
    if (options.format == "npy") stack_ = std::make_unique<Stack>(folder_ / "depth.npy");
  }

  void run(const mcap::Reader& file) {
    recording::RecordingHandlers handlers;
    handlers.frame = [this](const v1::Frame& frame, std::uint64_t time) {
      return take(frame, time);
    };
    handlers.event = [this](const v1::Event& event, std::uint64_t time) {
      if (next_ >= range_.first) events_.write(line_of(event, time));
      return true;
    };
    recording::read_recording(file, handlers);
    if (stack_) stack_->finish();
    frames_.close();
    events_.close();
    if (taken_ == 0) {
      throw std::runtime_error(fmt::format("{}: of its {} frames none is among --frames {}",
                                           options_.recording, next_, options_.frames));
    }
  }

  [[nodiscard]] std::uint64_t frames() const { return taken_; }
  [[nodiscard]] std::uint64_t maps() const { return maps_; }

 private:
  bool take(const v1::Frame& frame, std::uint64_t time) {
    if (cli::Interruptible::happened()) {
      throw std::runtime_error("interrupted: nothing was written");
    }
    const std::uint64_t index = next_++;
    if (index >= range_.last) return false;
    if (index < range_.first) return true;
    ++taken_;
    frames_.write(line_of(frame, index, time, write_map(frame, index)));
    return true;
  }

  /// Returns the map's name: a file, or its place in depth.npy; empty when there is none.
  std::string write_map(const v1::Frame& frame, std::uint64_t index) {
    if (!frame.has_depth() || options_.format == "csv") return {};
    const auto mm = client::millimetres_of(frame.depth());
    const cli::DepthImage depth = cli::depth_image(frame, mm);
    const std::uint64_t map = maps_++;
    if (stack_) {
      stack_->add(depth, index);
      return std::to_string(map);
    }
    std::string name = fmt::format("depth-{:06}.{}", index, options_.format);
    Output output(folder_ / name);
    output.write(cli::encoder_for(name, cli::encode_micrometre_png)(depth));
    output.close();
    return name;
  }

  const ExportOptions& options_;
  fs::path folder_;
  Range range_;
  Output frames_;
  Output events_;
  std::unique_ptr<Stack> stack_;
  std::uint64_t next_ = 0;
  std::uint64_t taken_ = 0;
  std::uint64_t maps_ = 0;
};

bool is_exported(const std::string& name) {
  static const std::regex kExported(
      R"(frames\.csv|events\.csv|depth\.npy|depth-\d{6,}\.(png|ply|pcd))");
  return std::regex_match(name, kExported);
}

/// Removes what an earlier export left in the folder; other files stay.
void remove_earlier(const fs::path& folder) {
  std::vector<fs::path> earlier;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (is_exported(entry.path().filename().string())) earlier.push_back(entry.path());
  }
  for (const fs::path& file : earlier) fs::remove(file);
}

constexpr const char* kUnfinished = ".dtactctl-export";

/// What is in the folder, without an export that did not come to its end.
std::vector<fs::path> files_in(const fs::path& folder) {
  std::vector<fs::path> files;
  for (const auto& entry : fs::directory_iterator(folder)) {
    if (entry.path().filename() != kUnfinished) files.push_back(entry.path());
  }
  return files;
}

/// The folder of an export within the one it is for, until it is whole: an earlier export stays
/// until then. What a killed export left there goes.
class Unfinished {
 public:
  /// Throws std::runtime_error where another program exports there.
  explicit Unfinished(const fs::path& folder) : folder_(folder), path_(folder / kUnfinished) {
    fs::create_directories(path_);
    lock_.reset(::open(path_.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (lock_ && ::flock(lock_.get(), LOCK_EX | LOCK_NB) != 0 && errno == EWOULDBLOCK) {
      throw std::runtime_error(folder_.string() + ": another program is exporting to it");
    }
    for (const fs::path& file : files_in(path_)) fs::remove_all(file);
  }
  ~Unfinished() {
    std::error_code ignored;
    if (!whole_) fs::remove_all(path_, ignored);
  }
  Unfinished(const Unfinished&) = delete;
  Unfinished& operator=(const Unfinished&) = delete;

  [[nodiscard]] const fs::path& path() const { return path_; }
  /// Puts the files in the place of an earlier export's. Where that fails they stay, and the
  /// std::runtime_error says where.
  void finish() {
    whole_ = true;
    try {
      remove_earlier(folder_);
      for (const fs::path& file : files_in(path_)) fs::rename(file, folder_ / file.filename());
      fs::remove(path_);
    } catch (const fs::filesystem_error& e) {
      throw std::runtime_error(fmt::format("{}; the export is in {}", e.what(), path_.string()));
    }
  }

 private:
  fs::path folder_;
  fs::path path_;
  base::UniqueFd lock_;  ///< It ends with the program, however that ends.
  bool whole_ = false;
};

void run_export(const cli::Context& context, const ExportOptions& options) {
  const cli::Interruptible while_writing;
  const mcap::Reader file(options.recording);
  if (!options.force && fs::exists(options.output) && !files_in(options.output).empty()) {
    throw std::runtime_error(options.output + " is not empty: name another folder, or add --force");
  }
  Unfinished unfinished(options.output);
  Exporter exporter(options, unfinished.path());
  exporter.run(file);
  unfinished.finish();
  cli::RecordingReport report;
  report.set_frames(exporter.frames());
  report.set_maps(exporter.maps());
  report.set_output(options.output);
  report.set_damage(file.damage());
  report.set_out_of_order(file.out_of_order());
  if (context.json) {
    context.out << cli::json_line(report);
    return;
  }
  context.out << fmt::format("{}: {} frames, {} depth maps\n", report.output(), report.frames(),
                             report.maps());
  if (!report.damage().empty()) {
    context.out << fmt::format("parts of the recording could not be read and were skipped: {}\n",
                               report.damage());
  }
  if (report.out_of_order() > 0) {
    context.out << fmt::format("{} messages are earlier than one before them; the order is kept\n",
                               report.out_of_order());
  }
}

}  // namespace

void add_export(CLI::App& app, cli::Context& context) {
  auto* command =
      app.add_subcommand("export", "Write a recording's depth, contacts and events as files");
  const auto options = std::make_shared<ExportOptions>();
  command->add_option("RECORDING", options->recording, "A file of dtactctl record")
      ->required()
      ->check(CLI::ExistingFile);
  command
      ->add_option("--to", options->format,
                   "npy: depth.npy, float32 mm (maps, rows, columns), NaN where untrusted; "
                   "png: a file a frame, 16-bit micrometres, 0 where untrusted or not pressed; "
                   "ply, pcd: a file a frame, points with normals in m in the surface frame; "
                   "csv: none. All write frames.csv (contact, times) and events.csv")
      ->required()
      ->check(CLI::IsMember({"npy", "png", "ply", "pcd", "csv"}));
  command->add_option("-o,--output", options->output, "The folder to write")
      ->type_name("FOLDER")
      ->required();
  command->add_option("--frames", options->frames, "FIRST:END, counted from 0; END is left out")
      ->check([](const std::string& text) {
        return parse_range(text) ? "" : "\"" + text + "\" is not FIRST:END, as 0:100 is";
      });
  command->add_flag(
      "--force", options->force,
      "Also into a folder that is not empty: replaces what an earlier export wrote there");
  cli::add_json_option(*command, context);
  command->callback([&context, options] { run_export(context, *options); });
}

}  // namespace dtact::ctl
