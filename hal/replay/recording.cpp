#include "hal/replay/recording.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <map>
#include <span>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "hal/base/atomic_file.hpp"
#include "hal/base/folder.hpp"
#include "hal/base/utf8.hpp"
#include "hal/files/png.hpp"
#include "hal/mjpeg/grey_decoder.hpp"

namespace dtact::hal::replay {
namespace {

namespace fs = std::filesystem;

constexpr const char* kTimestamps = "timestamps.csv";
constexpr int kMaxPixels = 16384;  // of a side: what luma buffers and the decoder take

std::string lower_extension(const fs::path& file) {
  std::string extension = file.extension().string();
  std::ranges::transform(extension, extension.begin(), [](unsigned char c) {
    return static_cast<char>(c >= 'A' && c <= 'Z' ? c + ('a' - 'A') : c);
  });
  return extension;
}

std::vector<fs::path> frames_in(const fs::path& folder) {
  std::vector<fs::path> png;
  std::vector<fs::path> jpeg;
  try {
    for (const fs::path& file : base::visible_files(folder)) {
      const std::string extension = lower_extension(file);
      if (extension == ".png") png.push_back(file);
      if (extension == ".jpg" || extension == ".jpeg") jpeg.push_back(file);
    }
  } catch (const fs::filesystem_error& e) {
    fail(folder, fmt::format("cannot read the recording ({}): set camera.replay.folder to a folder "
                             "of PNG or JPEG frames, or to an .mcap file",
                             e.code().message()));
  }
  if (png.empty() && jpeg.empty()) {
    fail(folder,
         "holds no *.png, *.jpg or *.jpeg frames: set camera.replay.folder to one that does");
  }
  if (!png.empty() && !jpeg.empty()) {
    fail(folder, fmt::format("holds both PNG ({}) and JPEG ({}) frames: put them in two folders",
                             png.front().filename().string(), jpeg.front().filename().string()));
  }
  return png.empty() ? jpeg : png;
}

void check_size(Recording& recording, int width, int height, const fs::path& file) {
  if (width > kMaxPixels || height > kMaxPixels) {
    fail(file, fmt::format("is {}x{} pixels, a side has at most {}: remove the file", width, height,
                           kMaxPixels));
  }
  if (recording.count() == 0) {
    recording.width = width;
    recording.height = height;
  } else if (width != recording.width || height != recording.height) {
    fail(file, fmt::format("is {}x{} pixels, the frames before it {}x{}: a recording has one size",
                           width, height, recording.width, recording.height));
  }
}

void add_png(Recording& recording, const fs::path& file) {
  const image::Grey8 image = image::read_png_grey8(file);
  check_size(recording, image.width, image.height, file);
  luma::LumaBuffer buffer(image.width, image.height);
  for (int y = 0; y < image.height; ++y) {
    std::copy_n(image.pixels.data() + std::ptrdiff_t{y} * image.width, image.width, buffer.row(y));
  }
  recording.images.push_back(std::move(buffer));
}

std::map<std::string, std::int64_t> read_timestamps(const fs::path& file) {
  std::map<std::string, std::int64_t> times;
  std::istringstream text(base::read_text_file(file));
  std::string line;
  for (int number = 1; std::getline(text, line); ++number) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (line.empty()) continue;
    const std::size_t comma = line.find(',');
    std::int64_t ns = 0;
    const char* const end = line.data() + line.size();
    const char* const begin = comma == std::string::npos ? end : line.data() + comma + 1;
    const auto [stop, error] = std::from_chars(begin, end, ns);
    if (error != std::errc() || stop != end) {
      if (number == 1) continue;  // the columns' names
      fail(file, fmt::format("line {}: \"{}\" is not \"file name,nanoseconds\"", number, line));
    }
    if (!times.emplace(line.substr(0, comma), ns).second) {
      fail(file, fmt::format("line {}: {} stands there twice", number, line.substr(0, comma)));
    }
  }
  return times;
}

std::vector<std::int64_t> offsets_of(const std::vector<fs::path>& files, const fs::path& csv) {
  const auto times = read_timestamps(csv);
  std::vector<std::int64_t> offsets;
  std::int64_t first = 0;
  for (const fs::path& file : files) {
    const std::string name = file.filename().string();
    const auto found = times.find(name);
    if (found == times.end()) fail(csv, fmt::format("has no line for {}: add it", name));
    if (offsets.empty()) first = found->second;
    std::int64_t offset = 0;
    if (__builtin_sub_overflow(found->second, first, &offset) || offset > kLongestNs) {
      fail(csv, fmt::format("{} is more than a year after the first frame: times are nanoseconds",
                            name));
    }
    if (!offsets.empty() && offset <= offsets.back()) {
      fail(csv, fmt::format("{} is not later than the frame before it: frames play in the order of "
                            "their names",
                            name));
    }
    offsets.push_back(offset);
  }
  return offsets;
}

}  // namespace

void fail(const fs::path& where, const std::string& what) {
  throw std::runtime_error(fmt::format("{}: {}", where.string(), what));
}

void add_jpeg(Recording& recording, std::string payload, mjpeg::GreyDecoder& decoder,
              const fs::path& name) {
  mjpeg::Size size;
  const auto status = decoder.read_size(
      {reinterpret_cast<const std::uint8_t*>(payload.data()), payload.size()}, size);
  if (status != mjpeg::Status::ok) {
    fail(name, fmt::format("{}: {}", mjpeg::describe(status),
                           status == mjpeg::Status::unsupported
                               ? "save the frames as baseline JPEG, or as PNG"
                               : "remove it"));
  }
  check_size(recording, size.width, size.height, name);
  recording.payloads.push_back(std::move(payload));
  recording.names.push_back(base::as_utf8(name.string()));
}

Recording load_recording(const fs::path& path) {
  if (lower_extension(path) == ".mcap" && !fs::is_directory(path)) return load_mcap(path);
  const fs::path& folder = path;
  const std::vector<fs::path> files = frames_in(folder);
  Recording recording;
  mjpeg::GreyDecoder decoder(1, 1);  // for headers only
  std::size_t bytes = 0;
  for (const fs::path& file : files) {
    if (lower_extension(file) == ".png") {
      add_png(recording, file);
      const luma::LumaBuffer& added = recording.images.back();
      bytes += static_cast<std::size_t>(added.stride()) * static_cast<std::size_t>(added.height());
    } else {
      add_jpeg(recording, base::read_file(file), decoder, file);
      bytes += recording.payloads.back().size();
    }
    if (bytes > kMaxBytes) {
      fail(folder, fmt::format("more than {} MiB of frames, of which {} are read: split the "
                               "recording, or keep it as JPEG",
                               kMaxBytes >> 20U, recording.count()));
    }
  }
  if (fs::exists(folder / kTimestamps)) {
    recording.offsets_ns = offsets_of(files, folder / kTimestamps);
  }
  return recording;
}

}  // namespace dtact::hal::replay
