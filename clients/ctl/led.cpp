#include <fmt/format.h>

#include <memory>
#include <optional>
#include <ostream>

#include "clients/common/json.hpp"
#include "clients/ctl/light_delay.hpp"
#include "clients/ctl/light_text.hpp"
#include "clients/ctl/online.hpp"

namespace dtact::ctl {
namespace {

struct LedOptions {
  std::optional<std::uint32_t> brightness;
  std::optional<std::string> scheme;
  std::vector<std::string> leds;
  bool measure = false;
};

/// `remark`: what the ring has to say when it is only looked at.
v1::LightState run(const Context& context, const LedOptions& options, std::string& remark) {
  client::Client client(context.target);
  v1::SetLight change;
  if (options.brightness) change.set_brightness(*options.brightness);
  if (options.scheme) change.set_scheme(*options.scheme);
  if (!options.leds.empty()) {
    // The wire wants all eight: those that are not named stay as they are, or as the scheme says.
    v1::LightState now = client.status().light();
    if (options.scheme) {
      v1::SetLight scheme;
      scheme.set_scheme(*options.scheme);
      now = client.set_light(scheme);
      change.clear_scheme();
    }
    *change.mutable_leds() = now.leds();
    for (const auto& text : options.leds) {
      const auto [index, colour] = parse_led(text);
      if (index >= change.leds_size()) {
        throw std::invalid_argument(
            fmt::format("--led {}: the ring has {} LEDs", text, change.leds_size()));
      }
      *change.mutable_leds(index) = colour;
    }
  }
  const bool changes = options.brightness || options.scheme || !options.leds.empty();
  if (changes) return client.set_light(change);
  const v1::Status status = client.status();
  remark = status.ring().message();
  return status.light();
}

void run_led(const Context& context, const LedOptions& options) {
  std::string remark;
  const v1::LightState light = run(context, options, remark);
  context.out << (context.json ? cli::json_line(light) : text_of(light) + '\n');
  if (!context.json && !remark.empty()) context.out << remark << '\n';
}

}  // namespace

void add_led(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand("led", "Change the light; without options, show it");
  const auto options = std::make_shared<LedOptions>();
  command->add_option("--brightness", options->brightness, "0 (off) to 255")
      ->check(CLI::Range(0, 255));
  command->add_option("--scheme", options->scheme,
                      "White LEDs by name: all, or scheme1 to scheme4, four of the eight");
  command
      ->add_option("--led", options->leds,
                   "NUMBER:RRGGBB, one LED's colour; may be given again. LED 0 is at the "
                   "image's right, the others follow clockwise")
      ->allow_extra_args(false)
      ->check([](const std::string& text) {
        try {
          (void)parse_led(text);
          return std::string();
        } catch (const std::invalid_argument& e) {
          return std::string(e.what());
        }
      });
  command
      ->add_flag(
          "--measure", options->measure,
          "Measure how many frames a change of the light takes until the picture shows it, by "
          "stepping the brightness for some seconds, and print the line for the "
          "configuration. Nothing may touch; the light is as before afterwards")
      ->excludes("--brightness", "--scheme", "--led");
  cli::add_json_option(*command, context);
  command->callback([&context, options] {
    if (options->measure) {
      measure_light_delay(context);
    } else {
      run_led(context, *options);
    }
  });
}

void add_rezero(CLI::App& app, Context& context) {
  auto* command =
      app.add_subcommand("rezero", "Take a new reference image; refused during contact");
  const auto force = std::make_shared<bool>(false);
  command->add_flag("--force", *force, "Also during contact: it will read as zero depth");
  command->callback([&context, force] { client::Client(context.target).rezero(*force); });
}

}  // namespace dtact::ctl
