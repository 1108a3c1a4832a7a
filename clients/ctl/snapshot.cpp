#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <ostream>
#include <stdexcept>

#include "clients/common/depth_file.hpp"
#include "clients/common/depth_message.hpp"
#include "clients/common/json.hpp"
#include "clients/common/reports.pb.h"
#include "clients/cpp/maps.hpp"
#include "clients/cpp/names.hpp"
#include "clients/ctl/online.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/files/png.hpp"

namespace dtact::ctl {
namespace {

struct SnapshotOptions {
  std::string output;
  bool luma = false;
  double timeout_s = 5;
};

/// The next frame that holds what is asked for.
v1::Frame fetch(client::Client& client, const SnapshotOptions& options) {
  v1::Subscribe subscription;
  subscription.set_depth(options.luma ? v1::DEPTH_NONE : v1::DEPTH_PREDICT_ZSTD);
  subscription.set_luma(options.luma ? v1::LUMA_GREY8 : v1::LUMA_NONE);
  client.subscribe(subscription);
  const auto end = std::chrono::steady_clock::now() +
                   std::chrono::milliseconds(static_cast<std::int64_t>(options.timeout_s * 1e3));
  for (;;) {
    const auto left =
        std::chrono::ceil<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    if (left.count() <= 0) break;
    auto message = client.next(left);
    if (!message.has_value()) break;
    auto* frame = std::get_if<v1::Frame>(&*message);
    if (frame == nullptr) continue;
    if (options.luma ? frame->has_luma() : frame->has_depth()) {
      return std::move(*frame);
    }
  }
  const auto status = client.status();
  throw std::runtime_error(fmt::format("no {} came within {:g} s; the daemon's state is {}. {}",
                                       options.luma ? "image" : "depth", options.timeout_s,
                                       client::name_of(status.state()), status.advice()));
}

std::string encode(const v1::Frame& frame, const SnapshotOptions& options) {
  if (options.luma) {
    return image::encode_png(image::Grey8{static_cast<int>(frame.luma().width()),
                                          static_cast<int>(frame.luma().height()),
                                          client::pixels_of(frame.luma())});
  }
  const auto mm = client::millimetres_of(frame.depth());
  return cli::encoder_for(options.output, cli::encode_colour_png)(cli::depth_image(frame, mm));
}

void run_snapshot(const Context& context, const SnapshotOptions& options) {
  if (!options.luma) {
    (void)cli::encoder_for(options.output, cli::encode_colour_png);
  } else if (std::filesystem::path(options.output).extension() != ".png") {
    throw CLI::ValidationError("-o " + options.output, "with --luma the name must end in .png");
  }
  client::Client client(context.target);
  v1::Frame frame = fetch(client, options);
  base::write_file_atomically(options.output, encode(frame, options));
  if (context.json) {
    if (frame.has_depth()) frame.mutable_depth()->clear_data();
    if (frame.has_luma()) frame.mutable_luma()->clear_data();
    cli::SnapshotReport report;
    report.set_file(options.output);
    *report.mutable_frame() = std::move(frame);
    context.out << cli::json_line(report);
  } else {
    const auto flags = client::names_of(frame.health());
    context.out << fmt::format("{}: frame {}, deepest {:.3f} mm, contact {:.1f} mm2{}\n",
                               options.output, frame.sequence(), frame.contact().deepest_mm(),
                               frame.contact().area_mm2(),
                               flags.empty() ? "" : fmt::format(", {}", fmt::join(flags, ", ")));
  }
}

}  // namespace

void add_snapshot(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand("snapshot", "Save one frame of the running daemon");
  const auto options = std::make_shared<SnapshotOptions>();
  command
      ->add_option("-o,--output", options->output,
                   "depth.npy (float32 mm, NaN where untrusted), depth.png (colours, the deeper, "
                   "the lighter) "
                   "or depth.ply or .pcd (points with normals, m); with --luma a .png")
      ->type_name("FILE")
      ->required();
  command->add_flag("--luma", options->luma, "The camera's grey image instead of the depth");
  command->add_option("--timeout", options->timeout_s, "Seconds to wait for a frame")
      ->capture_default_str()
      ->check(cli::positive());
  cli::add_json_option(*command, context);
  command->callback([&context, options] { run_snapshot(context, *options); });
}

}  // namespace dtact::ctl
