#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <filesystem>
#include <memory>
#include <ostream>
#include <stdexcept>

#include "clients/calibrate/offline/depth_file.hpp"
#include "clients/ctl/json/json.hpp"
#include "clients/ctl/online.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/image/png.hpp"

namespace dtact::ctl {
namespace {

struct SnapshotOptions {
  std::string output;
  bool luma = false;
  double timeout_s = 5;
};

using Encode = std::string (*)(const DepthImage&);

Encode encoder_for(const std::string& path) {
  const std::string extension = std::filesystem::path(path).extension().string();
  if (extension == ".npy") return encode_npy;
  if (extension == ".png") return encode_colour_png;
  if (extension == ".ply") return encode_ply;
  throw CLI::ValidationError("-o " + path, "the name must end in .npy, .png or .ply");
}

/// The next frame that holds what is asked for.
client::Frame fetch(client::Client& client, const SnapshotOptions& options) {
  client::Subscription subscription;
  subscription.depth = options.luma ? client::Depth::none : client::Depth::delta_zstd;
  subscription.luma = options.luma ? client::Luma::grey8 : client::Luma::none;
  client.subscribe(subscription);
  const auto end = std::chrono::steady_clock::now() +
                   std::chrono::milliseconds(static_cast<std::int64_t>(options.timeout_s * 1e3));
  for (;;) {
    const auto left =
        std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    if (left.count() <= 0) break;
    auto message = client.next(left);
    if (!message.has_value()) break;
    auto* frame = std::get_if<client::Frame>(&*message);
    if (frame == nullptr) continue;
    if (options.luma ? frame->luma.has_value() : frame->depth.has_value()) {
      return std::move(*frame);
    }
  }
  const auto status = client.status();
  throw std::runtime_error(fmt::format("no {} came within {:g} s; the daemon's state is {}. {}",
                                       options.luma ? "image" : "depth", options.timeout_s,
                                       status.state, status.advice));
}

std::string encode(const client::Frame& frame, const SnapshotOptions& options) {
  if (options.luma) {
    return image::encode_png(
        image::Grey8{frame.luma->width, frame.luma->height, frame.luma->values});
  }
  const auto mm = frame.depth->millimetres();
  return encoder_for(options.output)(
      {frame.depth->width, frame.depth->height, frame.depth->mm_per_px, mm});
}

void run_snapshot(const Context& context, const SnapshotOptions& options) {
  if (!options.luma) {
    (void)encoder_for(options.output);
  } else if (std::filesystem::path(options.output).extension() != ".png") {
    throw CLI::ValidationError("-o " + options.output, "with --luma the name must end in .png");
  }
  client::Client client(context.target);
  const auto frame = fetch(client, options);
  base::write_file_atomically(options.output, encode(frame, options));
  if (context.json) {
    Json json;
    json.open('{').member("file", options.output).member("sequence", frame.sequence);
    json.member("monotonic_ns", frame.monotonic_ns).member("wall_ns", frame.wall_ns);
    json.member("touching", frame.contact.touching).member("area_mm2", frame.contact.area_mm2);
    json.member("deepest_mm", frame.contact.deepest_mm).member("health", frame.health);
    context.out << json.close('}').text() << '\n';
  } else {
    context.out << fmt::format(
        "{}: frame {}, deepest {:.3f} mm, contact {:.1f} mm2{}\n", options.output, frame.sequence,
        frame.contact.deepest_mm, frame.contact.area_mm2,
        frame.health.empty() ? "" : fmt::format(", {}", fmt::join(frame.health, ", ")));
  }
}

}  // namespace

void add_snapshot(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand("snapshot", "Save one frame of the running daemon");
  const auto options = std::make_shared<SnapshotOptions>();
  command
      ->add_option("-o,--output", options->output,
                   "depth.npy (float32 mm, NaN where untrusted), depth.png (colours) or depth.ply "
                   "(points, mm); with --luma a .png")
      ->required();
  command->add_flag("--luma", options->luma, "The camera's grey image instead of the depth");
  command->add_option("--timeout", options->timeout_s, "Seconds to wait for a frame")
      ->capture_default_str()
      ->check(CLI::PositiveNumber);
  command->callback([&context, options] { run_snapshot(context, *options); });
}

}  // namespace dtact::ctl
