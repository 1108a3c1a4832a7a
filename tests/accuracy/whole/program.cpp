#include "tests/accuracy/whole/program.hpp"

#include <Eigen/SVD>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <span>
#include <stdexcept>
#include <utility>
#include <variant>
#include <vector>

#include "clients/perceive/upstream_subscription.hpp"
#include "daemon/calibration/calibration.hpp"
#include "daemon/net/frame_encoder.hpp"
#include "daemon/pipeline/active_calibration.hpp"
#include "daemon/pipeline/capture_loop.hpp"
#include "daemon/serve/subscription.hpp"
#include "hal/luma/luma.hpp"
#include "hal/mjpeg/grey_decoder.hpp"
#include "hal/null/null.hpp"
#include "hal/sim/payload.hpp"
#include "hal/sim/renderer.hpp"
#include "proto/dtact.pb.h"
#include "tests/fakes/fake_clock.hpp"

namespace dtact::whole {
namespace {

net::Subscription accepted(const v1::Subscribe& request, net::Serves serves) {
  return std::get<net::Subscription>(net::Subscription::from(request, {}, serves));
}

/// hal::sim::SimCamera without its thread and with a truth that others share.
class Camera final : public hal::Camera, private hal::FrameOwner {
 public:
  Camera(const std::shared_ptr<const hal::sim::Truth>& truth, const Settings& settings,
         fakes::FakeClock& clock)
      : model_(truth->scene().camera),
        sensor_(truth->scene().sensor),
        clock_(clock),
        renderer_(truth, truth->scene(), settings.seed),
        lighting_(settings.lighting),
        output_(hal::sim::output_from_name(settings.output)),
        encoder_(output_, model_.width, model_.height),
        decoder_(model_.width, model_.height),
        exposed_(model_.width, model_.height),
        received_(model_.width, model_.height),
        payload_(encoder_.capacity()) {}

  [[nodiscard]] hal::CameraInfo info() const override {
    hal::CameraInfo info;
    info.backend = "sim";
    info.identity = "sim:" + sensor_;
    info.pixel_format = std::array{"GREY", "YUYV", "MJPEG"}.at(static_cast<std::size_t>(output_));
    info.width = model_.width;
    info.height = model_.height;
    info.fps = model_.fps;
    info.light_delay_frames = model_.light_delay_frames;
    const auto control = [](const char* name, double value) {
      return hal::CameraControl{name, std::llround(value * 1000), hal::ControlVerdict::confirmed};
    };
    info.controls = {control("exposure_permille", model_.exposure),
                     control("gamma_permille", model_.gamma)};
    return info;
  }
  [[nodiscard]] hal::CameraReport report() const override { return {}; }
  void start() override {}
  void will_read(const hal::Area& area) noexcept override { decoder_.set_crop(area); }

  [[nodiscard]] hal::GrabStatus grab(hal::Frame& out,
                                     std::chrono::nanoseconds /*timeout*/) noexcept override {
    const std::uint64_t sequence = next_++;
    const Lighting light = lighting_ ? lighting_(sequence) : Lighting{};
    renderer_.set_gain(light.gain);
    renderer_.render(sequence, light.leds, exposed_.data(), exposed_.stride(), model_.height);
    const std::span bytes = std::span(payload_).first(encoder_.encode(exposed_.view(), payload_));
    if (!receive(bytes)) return hal::GrabStatus::damaged;
    const double due_ns = static_cast<double>(sequence + 1) * 1e9 / model_.fps;
    clock_.now = std::max(clock_.now.load(), static_cast<std::int64_t>(due_ns));
    hal::FrameInfo info;
    info.sequence = sequence;
    info.timestamp_ns = info.ready_ns = clock_.now;
    info.meaning = hal::TimestampMeaning::end_of_frame;
    out = hal::Frame(*this, 0, received_.view(), info,
                     output_ == hal::sim::Output::mjpeg ? bytes : std::span<std::uint8_t>());
    return hal::GrabStatus::ok;
  }

 private:
  void give_back(int /*index*/) noexcept override {}

  bool receive(std::span<const std::uint8_t> bytes) noexcept {
    using hal::luma::ExtractStatus;
    using hal::luma::Layout;
    using hal::luma::Range;
    switch (output_) {
      case hal::sim::Output::luma:
        return extract(Layout::grey, Range::full, bytes, 0, received_) == ExtractStatus::ok;
      case hal::sim::Output::yuyv:
        return extract(Layout::yuyv, Range::limited, bytes, 0, received_) == ExtractStatus::ok;
      case hal::sim::Output::mjpeg:
        return decoder_.decode(bytes, received_.data(), received_.stride()) ==
               hal::mjpeg::Status::ok;
    }
    return false;
  }

  const hal::sim::CameraModel model_;
  const std::string sensor_;
  fakes::FakeClock& clock_;
  hal::sim::Renderer renderer_;
  const std::function<Lighting(std::uint64_t)> lighting_;
  const hal::sim::Output output_;
  hal::sim::PayloadEncoder encoder_;
  hal::mjpeg::GreyDecoder decoder_;
  hal::luma::LumaBuffer exposed_;
  hal::luma::LumaBuffer received_;
  std::vector<std::uint8_t> payload_;
  std::uint64_t next_ = 0;
};

pipeline::DepthFrame room_for(const recon::RectifyTable& table) {
  pipeline::DepthFrame frame;
  frame.depth_um.resize(static_cast<std::size_t>(table.width) *
                        static_cast<std::size_t>(table.height));
  return frame;
}

}  // namespace

net::FrameKind perceive_kind() {
  v1::Subscribe wish;
  wish.set_cloud(v1::CLOUD_INT16);
  wish.set_contact_box(true);
  wish.set_pose(true);
  perceive::UpstreamSubscription demand(true, 0);
  demand.add(accepted(wish, net::Serves::geometry));
  const net::Subscription daemon = accepted(demand.subscription(), net::Serves::images);
  return daemon.kind(daemon.parts());
}

net::FrameKind whole_map_kind() { return {.depth = v1::DEPTH_INT16}; }

std::shared_ptr<const hal::sim::Truth> solve(std::string_view scene) {
  return std::make_shared<const hal::sim::Truth>(hal::sim::parse_scene(scene, "scene"));
}

MapFrame map_frame(const hal::sim::Scene& scene, const std::filesystem::path& calibration) {
  const calibration::Calibration loaded = calibration::load(calibration);
  const recon::RectifyTable& table = loaded.model->rectify;
  const double mm_per_px = loaded.model->mm_per_px;
  constexpr int kEvery = 20;  // pixels
  std::vector<Eigen::Vector3d> there;
  std::vector<Eigen::Vector3d> here;
  for (int y = 0; y < table.height; y += kEvery) {
    for (int x = 0; x < table.width; x += kEvery) {
      const auto& entry = table.entries.at(static_cast<std::size_t>(y * table.width + x));
      const auto place = hal::sim::pixel_place(scene.camera, entry.x + entry.fx / 128.0,
                                               entry.y + entry.fy / 128.0);
      there.emplace_back(place.x_mm, place.y_mm, 0);
      here.emplace_back(mm_per_px * (x - 0.5 * (table.width - 1)),
                        mm_per_px * (y - 0.5 * (table.height - 1)), 0);
    }
  }
  const Eigen::Map<const Eigen::Matrix3Xd> from(there.front().data(), 3, std::ssize(there));
  const Eigen::Map<const Eigen::Matrix3Xd> to(here.front().data(), 3, std::ssize(here));
  const Eigen::Affine3d similar(Eigen::umeyama(from, to, true));
  MapFrame frame;
  frame.scale = std::cbrt(similar.linear().determinant());
  frame.from_scene = Eigen::Translation3d(similar.translation());
  frame.from_scene.linear() = similar.linear() / frame.scale;
  frame.rms_mm = std::sqrt((similar * from - to).colwise().squaredNorm().mean());
  return frame;
}

struct Program::Impl {
  Impl(const std::shared_ptr<const hal::sim::Truth>& truth,
       const std::shared_ptr<const calibration::Calibration>& calibration, const Settings& wanted)
      : settings(wanted),
        camera(truth, wanted, clock),
        exchange(room_for(calibration->model->rectify)),
        light(std::make_unique<hal::null::NullRing>(), settings.daemon.light, clock, exchange),
        loop({camera, light, exchange, clock}, settings.daemon,
             pipeline::activate(calibration, camera.info(), settings.daemon.reconstruction), false),
        encoder("dtact_surface") {
    exchange.wanted = pipeline::Wanted{.contact = true, .depth = true};
    loop.tracker().start();
  }

  const Settings settings;
  fakes::FakeClock clock;
  Camera camera;
  pipeline::Exchange exchange;
  pipeline::LightDriver light;
  pipeline::CaptureLoop loop;
  net::FrameEncoder encoder;
  const pipeline::DepthFrame* frame = nullptr;
};

Program::Program(const std::shared_ptr<const hal::sim::Truth>& truth,
                 const std::filesystem::path& calibration, const Settings& settings)
    : impl_(std::make_unique<Impl>(
          truth, std::make_shared<const calibration::Calibration>(calibration::load(calibration)),
          settings)) {}

Program::~Program() { impl_->loop.tracker().stop(); }

std::string Program::next() {
  impl_->loop.tracker().settle();  // otherwise its result may come a frame sooner or later
  impl_->loop.step();
  pipeline::Event event;
  while (impl_->exchange.events.pop(event)) {
  }
  const pipeline::DepthFrame* const fresh = impl_->exchange.slot.fetch();
  if (fresh == nullptr) throw std::runtime_error("the capture loop published no frame");
  impl_->frame = fresh;
  impl_->encoder.begin(*fresh);
  return as(impl_->settings.kind);
}

std::string Program::as(const net::FrameKind& kind) {
  if (impl_->frame == nullptr) throw std::logic_error("call next() first");
  const auto encoded = impl_->encoder.encode(kind);
  if (encoded == nullptr) throw std::runtime_error("the frame exceeds the wire's cap");
  return encoded->body;
}

const pipeline::DepthFrame& Program::frame() const {
  if (impl_->frame == nullptr) throw std::logic_error("call next() first");
  return *impl_->frame;
}

}  // namespace dtact::whole
