#include <CLI/CLI.hpp>
#include <memory>
#include <ostream>

#include "clients/ctl/json/json.hpp"
#include "clients/ctl/light_text.hpp"
#include "clients/ctl/online.hpp"

namespace dtact::ctl {
namespace {

struct LedOptions {
  client::LightChange change;
  std::vector<std::string> leds;
};

void run_led(const Context& context, LedOptions options) {
  client::Client client(context.target);
  auto& change = options.change;
  if (!options.leds.empty()) {
    // The wire wants all eight: those that are not named stay as they are, or as the scheme says.
    if (change.scheme.has_value()) {
      (void)client.set_light({{}, change.scheme, {}});
      change.scheme.reset();
    }
    change.leds = client.status().light.leds;
    for (const auto& text : options.leds) {
      const auto [index, colour] = parse_led(text);
      change.leds.at(index) = colour;
    }
  }
  const bool changes =
      change.brightness.has_value() || change.scheme.has_value() || !change.leds.empty();
  const auto light = changes ? client.set_light(change) : client.status().light;
  if (context.json) {
    Json json;
    add_light(light, json);
    context.out << json.text() << '\n';
  } else {
    context.out << text_of(light) << '\n';
  }
}

}  // namespace

void add_led(CLI::App& app, Context& context) {
  auto* command = app.add_subcommand("led", "Change the light; without options, show it");
  const auto options = std::make_shared<LedOptions>();
  command->add_option("--brightness", options->change.brightness, "0 (off) to 255")
      ->check(CLI::Range(0, 255));
  command->add_option("--scheme", options->change.scheme,
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
  command->callback([&context, options] { run_led(context, *options); });
}

void add_rezero(CLI::App& app, Context& context) {
  auto* command =
      app.add_subcommand("rezero", "Take the present image as untouched: the new reference");
  const auto force = std::make_shared<bool>(false);
  command->add_flag("--force", *force, "Also when something touches: it will read as zero depth");
  command->callback([&context, force] { client::Client(context.target).rezero(*force); });
}

}  // namespace dtact::ctl
