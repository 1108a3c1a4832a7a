#include "clients/calibrate/reprocess/reprocess.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <optional>
#include <ostream>
#include <stdexcept>

#include "clients/calibrate/reprocess/depth_reprocessor.hpp"
#include "clients/common/interruptible.hpp"
#include "clients/common/json.hpp"
#include "clients/common/reports.pb.h"
#include "clients/recording/channels.hpp"
#include "clients/recording/part_file_sink.hpp"
#include "clients/recording/read_recording.hpp"
#include "clients/recording/recording_writer.hpp"
#include "hal/base/atomic_file.hpp"
#include "hal/files/png.hpp"
#include "hal/luma/luma.hpp"
#include "hal/mjpeg/grey_decoder.hpp"

namespace dtact::reprocess {
namespace {

namespace fs = std::filesystem;

struct Options {
  std::string recording;
  std::string calibration;
  std::string output;
  int reference_frames = 0;
  bool force = false;
};

std::span<const std::uint8_t> payload_of(const v1::Frame& frame) {
  const std::string& data = frame.jpeg().data();
  return {reinterpret_cast<const std::uint8_t*>(data.data()), data.size()};
}

/// Whether the daemon would have measured depth in it with a calibration. While the light differs
/// from the reference's the daemon uses a scaled one, which no recording holds.
bool measurable(const v1::Frame& frame) {
  return !has(frame, v1::HEALTH_STARTING) && !has(frame, v1::HEALTH_LIGHT_UNSETTLED) &&
         !has(frame, v1::HEALTH_REFERENCE_STALE);
}

/// By what the daemon's frames were smaller than those of the calibration (camera.decode_scale):
/// its reference says so.
int frame_scale_of(const mcap::Reader& file, const calibration::Calibration& calibration) {
  const auto place = recording::find_attachment(file, recording::kCurrentReferencePng);
  if (!place) return 1;
  const image::Grey16 reference =
      image::decode_png_grey16(file.attachment(*place).data, recording::kCurrentReferencePng);
  const recon::RectifyTable& table = calibration.model->rectify;
  for (const int scale : {2, 4}) {
    if (reference.width * scale == table.frame_width &&
        reference.height * scale == table.frame_height) {
      return scale;
    }
  }
  return 1;
}

/// By what the daemon decoded the recording's JPEGs smaller, to frames of this width; 1 where there
/// is no JPEG that says so.
int jpeg_scale_of(const mcap::Reader& file, int frame_width) {
  hal::mjpeg::GreyDecoder headers(1, 1);
  hal::mjpeg::Size size;
  bool found = false;
  recording::RecordingHandlers handlers;
  handlers.frame = [&](const v1::Frame& frame, std::uint64_t) {
    found =
        frame.has_jpeg() && headers.read_size(payload_of(frame), size) == hal::mjpeg::Status::ok;
    return !found;
  };
  recording::read_recording(file, handlers);
  for (const int scale : {2, 4}) {
    if (found && size.width == scale * frame_width) return scale;
  }
  return 1;
}

class Reprocessor {
 public:
  Reprocessor(const Options& options, const cli::Context& context)
      : options_(options),
        calibration_(std::make_shared<const calibration::Calibration>(
            calibration::load(options.calibration))),
        file_(options.recording),
        frame_scale_(frame_scale_of(file_, *calibration_)),
        jpeg_scale_(jpeg_scale_of(file_, frame_width())),
        remaker_(calibration::for_scaled_frames(calibration_, frame_scale_)),
        decoder_(frame_width() * jpeg_scale_, frame_height() * jpeg_scale_, jpeg_scale_),
        luma_(frame_width(), frame_height()),
        sink_(options.output, options.force),
        writer_(sink_, {.program = context.target.program}) {}

  void run() {
    find_status();
    if (!recording::find_attachment(file_, recording::kCurrentReferencePng)) take_first_frames();
    recording::RecordingHandlers handlers;
    handlers.frame = [this](const v1::Frame& frame, std::uint64_t time) {
      take(frame, time);
      return true;
    };
    handlers.event = [this](const v1::Event& event, std::uint64_t) {
      // Contact is determined again.
      if (!event.has_contact()) writer_.add(event);
      return true;
    };
    recording::read_recording(file_, handlers);
    if (frames_ == 0) throw std::runtime_error(options_.recording + ": holds no frame");
    if (maps_ == 0) {
      throw std::runtime_error(options_.recording +
                               ": no frame of it holds a JPEG that depth can be made of: record "
                               "without --no-jpeg, from a camera that delivers JPEG");
    }
    writer_.finish();
    sink_.sync();
    sink_.give_name();
  }

  /// See DepthReprocessor::unsharpened().
  [[nodiscard]] std::uint64_t unsharpened() const noexcept { return remaker_.unsharpened(); }

  [[nodiscard]] cli::RecordingReport report() const {
    cli::RecordingReport report;
    report.set_output(options_.output);
    report.set_frames(frames_);
    report.set_maps(maps_);
    report.set_damage(file_.damage());
    report.set_out_of_order(file_.out_of_order());
    return report;
  }

 private:
  /// Of the decoded frames.
  [[nodiscard]] int frame_width() const {
    return calibration_->model->rectify.frame_width / frame_scale_;
  }
  [[nodiscard]] int frame_height() const {
    return calibration_->model->rectify.frame_height / frame_scale_;
  }

  /// Reads the daemon's status at the beginning of the recording. Recorders write it behind the
  /// first frame, whose depth needs it. The light that it followed counts only for the reference
  /// of that time.
  void find_status() {
    std::optional<mcap::AttachmentPlace> reference;  // that of the first frame
    bool retaken = false;                            // after the status, which is older
    recording::RecordingHandlers handlers;
    handlers.frame = [&](const v1::Frame&, std::uint64_t time) {
      if (!reference) {
        reference = recording::find_attachment(file_, recording::kCurrentReferencePng, time);
      }
      return reference ? time <= reference->log_time : !status_;
    };
    handlers.event = [&](const v1::Event& event, std::uint64_t time) {
      retaken |= event.has_reference() && (!reference || time <= reference->log_time);
      return true;
    };
    handlers.status = [&](const v1::Status& status, std::uint64_t) {
      if (!status_) status_ = status;
      return true;
    };
    recording::read_recording(file_, handlers);
    if (!status_) return;
    status_->clear_calibration();  // that of the depth before
    // The output holds the value that was used, so that it can be reprocessed in turn.
    if (!reference || retaken) status_->clear_light_followed();
  }

  bool decode(const v1::Frame& frame) {
    const auto status = decoder_.decode(payload_of(frame), luma_.data(), luma_.stride());
    if (status == hal::mjpeg::Status::wrong_size) {
      throw std::runtime_error(fmt::format("{}: its images have another size than the {}x{} of {}",
                                           options_.recording, frame_width() * jpeg_scale_,
                                           frame_height() * jpeg_scale_, options_.calibration));
    }
    return status == hal::mjpeg::Status::ok;
  }

  /// Takes the mean of the first frames, without contact according to the user.
  void take_first_frames() {
    if (options_.reference_frames == 0) {
      throw std::runtime_error(
          fmt::format("{} holds no {}: if there was no contact at its beginning, say so by "
                      "--reference-frames 32",
                      options_.recording, recording::kCurrentReferencePng));
    }
    std::vector<std::uint32_t> sums(pixels());
    std::uint32_t count = 0;
    recording::RecordingHandlers handlers;
    handlers.frame = [&](const v1::Frame& frame, std::uint64_t) {
      if (frame.has_jpeg() && measurable(frame) && decode(frame)) {
        for (int y = 0; y < frame_height(); ++y) {
          const std::uint8_t* row = luma_.row(y);
          std::uint32_t* sum = sums.data() + std::ptrdiff_t{y} * frame_width();
          for (int x = 0; x < frame_width(); ++x) sum[x] += row[x];
        }
        ++count;
      }
      return count < static_cast<std::uint32_t>(options_.reference_frames);
    };
    recording::read_recording(file_, handlers);
    if (count == 0) throw std::runtime_error(options_.recording + ": none of its frames is whole");
    std::vector<std::uint16_t> mean(sums.size());
    std::ranges::transform(sums, mean.begin(), [count](std::uint32_t sum) {
      return static_cast<std::uint16_t>((sum * 256 + count / 2) / count);
    });
    remaker_.set_reference(mean);
    reference_png_ =
        image::encode_png(image::Grey16{frame_width(), frame_height(), std::move(mean)});
  }

  [[nodiscard]] std::size_t pixels() const {
    return static_cast<std::size_t>(frame_width()) * static_cast<std::size_t>(frame_height());
  }

  /// Uses the reference of this time, where it changed.
  void follow_reference(std::uint64_t time) {
    const auto place = recording::find_attachment(file_, recording::kCurrentReferencePng, time);
    if (!place || place->offset == reference_at_) return;
    const bool first = std::exchange(reference_at_, place->offset) == 0;
    std::string png = file_.attachment(*place).data;
    // Recorders attach it again after another calibration, and its light is still followed.
    if (png == reference_png_) return;
    reference_png_ = std::move(png);
    const image::Grey16 image =
        image::decode_png_grey16(reference_png_, recording::kCurrentReferencePng);
    if (image.width != frame_width() || image.height != frame_height()) {
      throw std::runtime_error(fmt::format("{}: its {} has another size than the {}x{} of {}",
                                           options_.recording, recording::kCurrentReferencePng,
                                           frame_width(), frame_height(), options_.calibration));
    }
    remaker_.set_reference(image.pixels, first && status_ ? 1 + status_->light_followed() : 1);
    attach_due_ = true;
  }

  void take(v1::Frame frame, std::uint64_t time) {
    if (cli::Interruptible::happened()) {
      throw std::runtime_error("interrupted: nothing was written");
    }
    follow_reference(time);
    const bool was_in_contact = remaker_.in_contact();
    const bool made = frame.has_jpeg() && measurable(frame) && decode(frame);
    if (made) {
      remaker_.remake(luma_.view(), frame);
      ++maps_;
    } else {
      frame.clear_depth();
      frame.clear_contact();
    }
    writer_.add(frame);
    if (frames_++ == 0) {
      if (status_) writer_.add(*status_);
      attach("calibration.toml", "application/toml", "calibration.toml");
      attach("reference.png", "image/png", "reference.png");
    }
    if (attach_due_ || frames_ == 1) {
      writer_.attach(recording::kCurrentReferencePng, "image/png", reference_png_);
      attach_due_ = false;
    }
    if (made && remaker_.in_contact() != was_in_contact) write_contact_event(frame);
  }

  void attach(const char* name, const char* media_type, const char* file) {
    writer_.attach(name, media_type, base::read_file(fs::path(options_.calibration) / file));
  }

  void write_contact_event(const v1::Frame& frame) {
    v1::Event event;
    event.set_sequence(frame.sequence());
    event.set_monotonic_ns(frame.monotonic_ns());
    event.set_wall_ns(frame.wall_ns());
    event.mutable_contact()->set_sequence(frame.sequence());
    event.mutable_contact()->set_monotonic_ns(frame.monotonic_ns());
    *event.mutable_contact()->mutable_contact() = frame.contact();
    writer_.add(event);
  }

  const Options& options_;
  std::shared_ptr<const calibration::Calibration> calibration_;
  mcap::Reader file_;
  int frame_scale_;  // from the calibration's frames to the decoded ones
  int jpeg_scale_;   // from JPEGs to them; the same unless the calibration was made for them
  DepthReprocessor remaker_;
  hal::mjpeg::GreyDecoder decoder_;
  hal::luma::LumaBuffer luma_;
  recording::PartFileSink sink_;
  recording::RecordingWriter writer_;
  std::string reference_png_;         // the PNG of the reference in use
  std::uint64_t reference_at_ = 0;    // its place in the file
  std::optional<v1::Status> status_;  // see find_status()
  bool attach_due_ = false;
  std::uint64_t frames_ = 0;
  std::uint64_t maps_ = 0;
};

void run(const cli::Context& context, const Options& options) {
  if (fs::exists(options.output) && fs::equivalent(options.recording, options.output)) {
    throw std::runtime_error(options.output + " is the recording itself: name another file");
  }
  const cli::Interruptible while_writing;
  Reprocessor reprocessor(options, context);
  reprocessor.run();
  const auto report = reprocessor.report();
  if (context.json) {
    context.out << cli::json_line(report);
    return;
  }
  context.out << fmt::format("{}: {} frames, depth made anew in {}\n", report.output(),
                             report.frames(), report.maps());
  if (reprocessor.unsharpened() > 0) {
    context.out << fmt::format(
        "{} of these were sharpened when they were recorded and are plain now: {} has no LUT for "
        "as many steps (dtact-calibrate depth --method model makes them)\n",
        reprocessor.unsharpened(), options.calibration);
  }
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

void add_reprocess(CLI::App& app, cli::Context& context) {
  CLI::App* command = app.add_subcommand(
      "reprocess", "Make the depth of a recording anew with another calibration");
  const auto options = std::make_shared<Options>();
  command->add_option("RECORDING", options->recording, "A file of dtactctl record")
      ->required()
      ->check(CLI::ExistingFile);
  command->add_option("--calibration", options->calibration, "Calibration folder")
      ->type_name("FOLDER")
      ->required();
  command->add_option("-o,--output", options->output, "The recording to write")
      ->type_name("FILE")
      ->required();
  command
      ->add_option(
          "--reference-frames", options->reference_frames,
          "Number of frames without contact at the beginning, where the recording holds no "
          "reference image")
      ->check(CLI::Range(1, 1000));
  command->add_flag("--force", options->force, "Replace the file if it exists");
  cli::add_json_option(*command, context);
  command->callback([&context, options] { run(context, *options); });
}

}  // namespace dtact::reprocess
