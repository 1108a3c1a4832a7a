// Writes the seeds that are not text: fuzz_seeds tests/fuzz/corpus. With "large", instead those of
// megabytes: fuzz_seeds build/fuzz/corpus large
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <string>
#include <vector>

#include "daemon/calibration/text.hpp"
#include "hal/files/png.hpp"
#include "proto/depth_encoding.hpp"
#include "proto/dtact.pb.h"
#include "proto/framing.hpp"
#include "tests/fakes/hostile_files.hpp"
#include "tests/fakes/jpeg_maker.hpp"
#include "tests/unit/calibration/sample.hpp"

namespace dtact::fuzz {
namespace {

namespace fs = std::filesystem;

class Corpus {
 public:
  explicit Corpus(fs::path folder) : folder_(std::move(folder)) {}
  void add(const std::string& target, const std::string& name, const std::string& bytes) const {
    fs::create_directories(folder_ / target);
    std::ofstream(folder_ / target / name, std::ios::binary) << bytes;
  }

 private:
  fs::path folder_;
};

std::string framed(const std::string& body) {
  const auto length = wire::encode_length(body.size());
  return std::string(reinterpret_cast<const char*>(length.data()), length.size()) + body;
}

/// Splits like requests.cpp.
std::string counted(const std::string& body) {
  return std::string{static_cast<char>(body.size() % 256), static_cast<char>(body.size() / 256)} +
         body;
}

v1::ClientMessage request(const std::function<void(v1::ClientMessage&)>& fill) {
  static std::uint64_t id = 0;
  v1::ClientMessage message;
  message.set_id(++id);
  fill(message);
  return message;
}

void add_requests(const Corpus& corpus) {
  using M = v1::ClientMessage;
  const std::vector<std::pair<std::string, v1::ClientMessage>> all = {
      {"hello", request([](M& m) {
         m.mutable_hello()->set_major(1);
         m.mutable_hello()->set_program("seed");
       })},
      {"subscribe", request([](M& m) {
         m.mutable_subscribe()->set_depth(v1::DEPTH_INT16);
         m.mutable_subscribe()->set_luma(v1::LUMA_GREY8);
         m.mutable_subscribe()->set_every(2);
       })},
      {"set_light", request([](M& m) {
         m.mutable_set_light()->set_brightness(128);
         m.mutable_set_light()->set_scheme("scheme1");
         for (int i = 0; i < 8; ++i) m.mutable_set_light()->add_leds()->set_g(200);
       })},
      {"rezero", request([](M& m) { m.mutable_rezero()->set_force(true); })},
      {"get_status", request([](M& m) { m.mutable_get_status(); })},
      {"get_calibration", request([](M& m) { m.mutable_get_calibration()->set_number(1); })},
      {"upload_calibration", request([](M& m) {
         m.mutable_upload_calibration()->set_name("ball");
         m.mutable_upload_calibration()->set_calibration_toml("version = 1\n");
         m.mutable_upload_calibration()->set_reference_png("png");
       })},
      {"list_calibrations", request([](M& m) { m.mutable_list_calibrations(); })},
      {"activate_calibration",
       request([](M& m) { m.mutable_activate_calibration()->set_number(0); })},
      {"subscribe_parts", request([](M& m) {
         m.mutable_subscribe()->set_depth(v1::DEPTH_PREDICT_ZSTD);
         m.mutable_subscribe()->set_jpeg(true);
         m.mutable_subscribe()->set_depth_hz(30);
         m.mutable_subscribe()->set_decimation(2);
         m.mutable_subscribe()->set_um_per_unit(5);
         m.mutable_subscribe()->mutable_box()->set_width(3);
         m.mutable_subscribe()->mutable_box()->set_height(2);
         m.mutable_subscribe()->set_events(false);
       })},
      {"get_reference", request([](M& m) { m.mutable_get_reference(); })},
      {"pin_calibration", request([](M& m) {
         m.mutable_pin_calibration()->set_number(3);
         m.mutable_pin_calibration()->set_pinned(true);
       })},
      {"ping", request([](M& m) { m.mutable_ping(); })},
      {"set_camera", request([](M& m) {
         m.mutable_set_camera()->set_exposure_us(4170);
         m.mutable_set_camera()->set_gain(1.5);
       })},
      {"set_reconstruction", request([](M& m) {
         m.mutable_set_reconstruction()->set_resolution("half");
         m.mutable_set_reconstruction()->set_sharpen("auto");
         m.mutable_set_reconstruction()->set_max_error_um(30);
       })}};
  std::string stream;
  std::string session = "\x01";
  for (const auto& [name, message] : all) {
    const std::string body = message.SerializeAsString();
    corpus.add("requests", name, "\x01" + counted(body));
    stream += framed(body);
    session += counted(body);
  }
  corpus.add("requests", "session", session);
  corpus.add("requests", "stream", std::string(1, '\0') + stream);
  corpus.add("framing", "requests", stream);
  corpus.add("framing", "empty_message", framed("") + framed("x"));
  corpus.add("framing", "at_the_cap", framed(std::string(4096, 'x')) + framed(""));
  corpus.add("framing", "above_the_cap", framed(std::string(4097, 'x')));
}

v1::ServerMessage frame(v1::DepthEncoding encoding) {
  v1::ServerMessage message;
  auto& frame = *message.mutable_frame();
  frame.set_sequence(7);
  frame.set_monotonic_ns(1'000'000);
  frame.add_health(v1::HEALTH_LIGHT_UNSETTLED);
  frame.mutable_light()->set_brightness(128);
  frame.mutable_light()->add_leds()->set_r(255);
  frame.mutable_contact()->set_in_contact(true);
  frame.mutable_times()->set_decode_ns(300'000);
  const std::vector<std::int16_t> depth = {0, 10, -5, INT16_MIN, 1000, 16383};
  auto& map = *frame.mutable_depth();
  map.set_encoding(encoding);
  map.set_width(3);
  map.set_height(2);
  map.set_mm_per_px(0.05);
  map.set_um_per_unit(1);
  map.set_untrusted_value(INT16_MIN);
  map.set_decimation(1);
  wire::DepthEncoder().encode(encoding, depth, 3, *map.mutable_data());
  frame.mutable_luma()->set_encoding(v1::LUMA_GREY8);
  frame.mutable_luma()->set_width(2);
  frame.mutable_luma()->set_height(2);
  frame.mutable_luma()->set_data("luma");
  return message;
}

v1::ServerMessage points() {
  v1::ServerMessage message;
  auto& cloud = *message.mutable_frame()->mutable_cloud();
  cloud.set_encoding(v1::CLOUD_FLOAT32);
  cloud.set_width(2);
  cloud.set_height(1);
  cloud.set_points(2);
  cloud.set_metres_per_unit(1);
  cloud.set_data(std::string(2 * 6 * sizeof(float), '\0'));
  return message;
}

void add_answers(const Corpus& corpus) {
  corpus.add("answers", "frame_int16", frame(v1::DEPTH_INT16).SerializeAsString());
  corpus.add("answers", "frame_predict_zstd", frame(v1::DEPTH_PREDICT_ZSTD).SerializeAsString());
  corpus.add("web", "depth", frame(v1::DEPTH_PREDICT_ZSTD).SerializeAsString());
  corpus.add("web", "points", points().SerializeAsString());
  v1::ServerMessage message;
  message.mutable_reply()->set_id(3);
  auto& status = *message.mutable_reply()->mutable_status();
  status.set_state(v1::STATE_SERVING);
  status.add_health(v1::HEALTH_IMAGE_DARK);
  status.mutable_camera()->set_backend("sim");
  status.mutable_camera()->add_controls()->set_name("gain");
  status.mutable_calibration()->set_name("ball");
  status.add_stages()->set_stage("smooth");
  status.add_clients()->set_program("seed");
  corpus.add("answers", "status", message.SerializeAsString());
  auto& stored = *message.mutable_reply()->mutable_calibrations()->add_calibrations();
  stored.set_number(3);
  stored.set_uploaded("2026-01-31T12:00:00Z");
  stored.mutable_summary()->set_mm_per_px(0.05);
  message.mutable_reply()->mutable_calibrations()->add_calibrations()->set_damage("png");
  corpus.add("answers", "calibrations", message.SerializeAsString());
  message.mutable_event()->mutable_state()->set_state(v1::STATE_CAMERA_LOST);
  message.mutable_event()->mutable_state()->add_health(v1::HEALTH_CAMERA_FAULT);
  corpus.add("answers", "event_state", message.SerializeAsString());
  message.mutable_event()->mutable_contact()->mutable_contact()->set_x_mm(1.5);
  corpus.add("answers", "event_contact", message.SerializeAsString());
}

/// A map of a pressed slope with contact-free and untrusted parts, for depth_maps.cpp and, in each
/// encoding, for depth_decoders.cpp.
void add_depth(const Corpus& corpus, const std::string& name, std::size_t width,
               std::size_t height) {
  std::vector<std::int16_t> map;
  for (std::size_t y = 0; y < height; ++y) {
    for (std::size_t x = 0; x < width; ++x) {
      const auto pressed = static_cast<std::int16_t>(20 * x + x * y % 7);
      map.push_back(x < width / 3 ? std::int16_t{0} : x * y % 41 == 40 ? INT16_MIN : pressed);
    }
  }
  wire::DepthEncoder encoder;
  std::string bytes;
  for (const auto encoding : {v1::DEPTH_INT16, v1::DEPTH_PREDICT_ZSTD}) {
    encoder.encode(encoding, map, width, bytes);
    const std::string head{static_cast<char>(width), 0, static_cast<char>(height), 0,
                           static_cast<char>(encoding)};
    corpus.add("depth_decoders", name + '_' + std::to_string(encoding), head + bytes);
  }
  encoder.encode(v1::DEPTH_INT16, map, width, bytes);
  corpus.add("depth_maps", name, static_cast<char>(width - 1) + bytes);
}

void add_calibrations(const Corpus& corpus) {
  const auto add = [&corpus](const std::string& name, const calibration::Calibration& calibration) {
    calibration::Files files = calibration::format(calibration);
    const std::string key = "sha256 = \"";
    const std::size_t at = files.toml.find(key, files.toml.find("[reference]")) + key.size();
    files.toml.replace(at, 64, "@SHA@");
    corpus.add("calibration", name, files.toml + "\n#PNG\n" + files.reference_png);
  };
  calibration::Calibration calibration = calibration::sample();
  add("list", calibration);
  auto model = std::make_shared<recon::Model>(*calibration.model);
  model->method = recon::Method::published;
  model->gain = {};
  model->uncertainty.clear();
  calibration.model = model;
  add("published", calibration);
  calibration = calibration::sample();
  model = std::make_shared<recon::Model>(*calibration.model);
  calibration.lens = recon::Lens{.homography = {20, 0, 6, 0, 20, 4.5, 0, 0, 1},
                                 .centre_col = 5.5,
                                 .centre_row = 4,
                                 .radius_px = 10,
                                 .radial = {-0.05, 0.002}};
  std::vector<std::uint8_t> outside;
  model->untrusted.clear();
  model->rectify = recon::make_lens_table(*calibration.lens, 12, 9, {3, 2, 6, 5, 0.051}, outside);
  calibration.model = model;
  add("lens", calibration);
}

std::string jpeg(const fakes::JpegRecipe& recipe) {
  const auto bytes = fakes::make_jpeg(recipe, [](int x, int y) { return 40 + 3 * x + 2 * y; });
  return {bytes.begin(), bytes.end()};
}

void add_pictures(const Corpus& corpus) {
  const std::string crop = "\x05\x03\x0b\x09";
  fakes::JpegRecipe recipe{.width = 32, .height = 24, .quality = 80};
  const std::string colour = jpeg(recipe);
  corpus.add("mjpeg", "colour", crop + colour);
  corpus.add("mjpeg", "padded", crop + colour + std::string(32, '\0'));
  corpus.add("mjpeg", "doubled_start", crop + colour.substr(0, 2) + colour);
  recipe.huffman_tables = false;
  corpus.add("mjpeg", "standard_tables", crop + jpeg(recipe));
  recipe.huffman_tables = true;
  recipe.restart_rows = 1;
  corpus.add("mjpeg", "restarts", crop + jpeg(recipe));
  recipe.restart_rows = 0;
  recipe.progressive = true;
  corpus.add("mjpeg", "progressive", crop + jpeg(recipe));
  recipe.progressive = false;
  recipe.colour = false;
  const std::string grey = jpeg(recipe);
  corpus.add("mjpeg", "grey", crop + grey);

  image::Grey8 small{6, 4, std::vector<std::uint8_t>(24, 90)};
  small.pixels[7] = 200;
  const std::string png = image::encode_png(small);
  const std::string times = "file,ns\n1.XXX,100\n2.XXX,16666766\n";
  const auto with = [&times](const std::string& extension) {
    std::string text = times;
    for (std::size_t at = 0; (at = text.find("XXX")) != std::string::npos;) {
      text.replace(at, 3, extension);
    }
    return text;
  };
  corpus.add("recording", "png", "\n--\n" + png + "\n--\n" + png);
  corpus.add("recording", "png_times", with("png") + "\n--\n" + png + "\n--\n" + png);
  corpus.add("recording", "jpeg_times", with("jpg") + "\n--\n" + grey + "\n--\n" + grey);
  corpus.add("recording", "jpeg", "\n--\n" + colour);
  const image::Rgb8 rgb{2, 2, std::vector<std::uint8_t>(12, 77)};
  corpus.add("recording", "colour_png", "\n--\n" + image::encode_png(rgb));
}

void add_files(const Corpus& corpus) {
  corpus.add("png", "grey16",
             image::encode_png(
                 image::Grey16{5, 3, {0, 1, 255, 256, 65280, 65535, 7, 7, 7, 7, 7, 7, 7, 7, 7}}));
  const std::string grey8 =
      image::encode_png(image::Grey8{4, 2, {0, 50, 100, 150, 200, 250, 1, 2}});
  corpus.add("png", "grey8", grey8);
  corpus.add("png", "rgb8", image::encode_png(image::Rgb8{2, 1, {1, 2, 3, 250, 251, 252}}));
  corpus.add("png", "texts", fakes::with_text_chunks(grey8, 3, 100'000));
  corpus.add("toml", "deep", fakes::deep_toml(12));
  corpus.add("toml", "wide", fakes::wide_toml(300));
  corpus.add("toml", "keys", fakes::many_keys_toml(300));
}

/// Of the sizes that the wire carries.
void add_large(const Corpus& corpus) {
  constexpr std::size_t kWire = 16'700'000;
  const std::string tables = "a = " + std::string(kWire / 2, '[') + std::string(kWire / 2, ']');
  const std::string text = "a = \"" + std::string(kWire, 'x') + "\"\n";
  for (const char* target : {"toml", "config", "lens", "calibration"}) {
    corpus.add(target, "large_deep", fakes::deep_toml(kWire / 2));
    corpus.add(target, "large_wide", fakes::wide_toml(kWire));
    corpus.add(target, "large_keys", fakes::many_keys_toml(kWire));
    corpus.add(target, "large_tables", tables);
    corpus.add(target, "large_text", text);
    corpus.add(target, "max_wide", fakes::wide_toml(520'000));
    corpus.add(target, "max_keys", fakes::many_keys_toml(300'000));
  }
  corpus.add("png", "large_texts",
             fakes::with_text_chunks(fakes::grey16_png(40, 30), 2000, 7'900'000));
  corpus.add("png", "large_picture", fakes::grey16_png(4096, 2048));
}

}  // namespace
}  // namespace dtact::fuzz

int main(int argc, char** argv) {
  const bool large = argc == 3 && std::string(argv[2]) == "large";
  if (argc != 2 && !large) {
    std::cerr << "usage: fuzz_seeds FOLDER [large]\n";
    return 2;
  }
  const dtact::fuzz::Corpus corpus(argv[1]);
  if (large) {
    dtact::fuzz::add_large(corpus);
    return 0;
  }
  dtact::fuzz::add_files(corpus);
  dtact::fuzz::add_requests(corpus);
  dtact::fuzz::add_answers(corpus);
  dtact::fuzz::add_depth(corpus, "small", 5, 3);
  dtact::fuzz::add_depth(corpus, "large", 60, 41);
  dtact::fuzz::add_calibrations(corpus);
  dtact::fuzz::add_pictures(corpus);
  return 0;
}
