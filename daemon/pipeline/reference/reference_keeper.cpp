#include "daemon/pipeline/reference/reference_keeper.hpp"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace dtact::pipeline {

SettleDetector::SettleDetector(const ReferenceRules& rules)
    : frames_(static_cast<std::size_t>(rules.settle_frames)), grey_(rules.settle_grey) {
  if (rules.settle_frames < 2 || frames_ > kMax) {
    throw std::invalid_argument("reference: settle_frames must be 2 to 64");
  }
}

bool SettleDetector::add(float mean_grey) noexcept {
  means_[count_ % frames_] = mean_grey;
  ++count_;
  if (count_ < frames_) return false;
  const auto [least, most] =
      std::minmax_element(means_.begin(), means_.begin() + static_cast<std::ptrdiff_t>(frames_));
  return *most - *least < grey_;
}

namespace {

/// Too dark to be a reference, grey levels; reconstruction trusts nothing below that either.
constexpr float kUnlitGrey = 8;
/// While a reference is averaged no cell may move more than this, grey levels (0.03 mm).
constexpr float kStillGrey = 1;
/// Local darkening that counts as contact. Between two references of one sensor: at most 0.006; the
/// lightest press of the real images: 0.05 (ContactVerdict). 0.0125 is about 0.07 mm.
constexpr float kContactDarkening = 0.0125F;
/// The same between images under different light, of which the fit leaves a little: on the
/// simulated sensor at most 0.002 after dimming by half, 0.019 with only the LEDs of one half lit.
/// 0.13 mm.
constexpr float kContactUnderOtherLight = 0.025F;
/// The same where there was no contact right before the light changed: then only a plain press (0.2
/// mm) outweighs that, and what another set of LEDs leaves of the light's shape does not.
constexpr float kContactAfterNoContact = 0.04F;
/// A fit that explains less of the field has lost its way (most of it is pressed).
constexpr float kMinExplained = 0.5F;
constexpr int kFramesBetweenChecks = 8;
constexpr int kChecksWithoutContact = 2;

}  // namespace

ReferenceKeeper::ReferenceKeeper(int width, int height, const ReferenceRules& rules)
    : width_(width),
      height_(height),
      rules_(rules),
      settle_(rules),
      average_(width, height, rules.frames),
      good_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)),
      candidate_(good_.size()),
      fallback_(good_.size()) {
  if (width < kMinFrameWidth || height < kMinFrameHeight) {
    throw std::invalid_argument("camera: frames must have at least 80x60 pixels");
  }
}

void ReferenceKeeper::restore(std::span<const std::uint16_t> reference_q8, bool same_light,
                              bool same_shape) {
  if (reference_q8.size() != good_.size()) {
    throw std::invalid_argument("stored reference: not the size of the camera's frames");
  }
  std::ranges::copy(reference_q8, good_.begin());
  measure(good_, width_, height_, good_grid_);
  have_good_ = true;
  stored_ = true;
  good_same_light_ = same_light;
  other_light_ = !same_light;
  same_shape_ = same_shape;
}

void ReferenceKeeper::use_calibration(std::span<const std::uint16_t> reference_q8,
                                      const LumaGrid& grid, const CellRegion& region,
                                      bool same_light) noexcept {
  calibration_ = {reference_q8, &grid};
  region_ = region;
  if (ready() && quality_ == ReferenceQuality::fresh) return;
  if (quality_ != ReferenceQuality::none) have_good_ = false;
  if (!have_good_) {
    other_light_ = !same_light;
    same_shape_ = same_light;  // of another light it is not known
  }
  begin();
}

void ReferenceKeeper::begin() noexcept {
  phase_ = Phase::settling;
  quality_ = ReferenceQuality::none;
  starting_ = true;
  averaging_ = false;
  no_contact_before_ = false;
  waited_ = 0;
  dark_frames_ = 0;
  settle_.reset();
}

void ReferenceKeeper::light_changed(bool in_contact, bool same_shape) noexcept {
  same_shape_ = same_shape_ && same_shape;
  // During an earlier change nothing new is known about contact; the earlier knowledge still holds.
  if (ready()) no_contact_before_ = quality_ == ReferenceQuality::fresh && !in_contact;
  if (ready()) starting_ = false;
  phase_ = Phase::settling;
  quality_ = ReferenceQuality::none;
  good_same_light_ = false;
  other_light_ = true;
  averaging_ = false;
  waited_ = 0;
  dark_frames_ = 0;
  settle_.reset();
}

std::optional<Outcome> ReferenceKeeper::rezero(bool force, bool in_contact) noexcept {
  if (!force && in_contact && ready() && quality_ != ReferenceQuality::stale)
    return Outcome::refused_contact;
  request_ = Request{force};
  averaging_ = false;
  return std::nullopt;
}

bool ReferenceKeeper::looks() const noexcept {
  return phase_ != Phase::holding || averaging_ || request_ || quality_ != ReferenceQuality::fresh;
}

State ReferenceKeeper::state() const noexcept {
  switch (phase_) {
    case Phase::settling:
      return State::settling;
    case Phase::averaging:
      return State::referencing;
    case Phase::holding:
      break;
  }
  return State::serving;
}

std::span<const std::uint16_t> ReferenceKeeper::reference() const noexcept {
  return quality_ == ReferenceQuality::fresh ? std::span(good_) : std::span(fallback_);
}

ReferenceStep ReferenceKeeper::step(const hal::LumaView& luma) noexcept {
  if (phase_ == Phase::settling) return settle(luma);
  if (phase_ == Phase::averaging || averaging_) return gather(luma);
  if (request_) {
    start_average();
    averaging_ = true;
    return gather(luma);
  }
  if (quality_ != ReferenceQuality::fresh) watch(luma);
  return {};
}

void ReferenceKeeper::start_average() noexcept {
  average_.reset();
  waited_ = 0;
}

ReferenceStep ReferenceKeeper::settle(const hal::LumaView& luma) noexcept {
  measure(luma, now_);
  if (now_.mean < kUnlitGrey) {
    settle_.reset();
    waited_ = 0;
    dark_frames_ = std::min(dark_frames_ + 1, rules_.settle_frames);
    if (!std::exchange(request_, std::nullopt)) return {};
    return {.reference_changed = false, .answer = Outcome::refused_dark};
  }
  dark_frames_ = 0;
  if (settle_.add(now_.mean) || ++waited_ > rules_.timeout_frames) {
    // Depth need not wait for a new reference where the last run's is of the same light. The
    // picture has to agree: the ring's light says nothing of exposure, ambient light and the camera
    // itself.
    if (stored_ && have_good_ && good_same_light_ &&
        check_.compare(good_grid_, now_, region_, ContactCheck::kSameShape, field_).explained >=
            kMinExplained) {
      return use_fallback();
    }
    start_average();
    phase_ = Phase::averaging;
  }
  return {};
}

ReferenceStep ReferenceKeeper::gather(const hal::LumaView& luma) noexcept {
  measure(luma, now_);
  if (++waited_ > rules_.timeout_frames) return decide(Outcome::refused_unsteady);
  if (average_.added() > 0 && greatest_change(first_, now_, region_) > kStillGrey) average_.reset();
  if (average_.added() == 0) first_ = now_;
  if (!average_.add(luma)) return {};
  average_.write(candidate_);
  measure(candidate_, width_, height_, candidate_grid_);
  if (candidate_grid_.mean < kUnlitGrey) return decide(Outcome::refused_dark);
  if (request_ && request_->force) return take();
  now_ = candidate_grid_;
  return shows_contact(candidate_grid_) ? decide(Outcome::refused_contact) : take();
}

void ReferenceKeeper::watch(const hal::LumaView& luma) noexcept {
  if (++watched_ < kFramesBetweenChecks) return;
  watched_ = 0;
  measure(luma, now_);
  clear_ = now_.mean >= kUnlitGrey && !shows_contact(now_) ? clear_ + 1 : 0;
  if (clear_ < kChecksWithoutContact) return;
  clear_ = 0;
  start_average();
  averaging_ = true;
}

ReferenceStep ReferenceKeeper::take() noexcept {
  forced_ = is_doubtful();
  std::swap(good_, candidate_);
  good_grid_ = candidate_grid_;
  have_good_ = true;
  stored_ = false;
  good_same_light_ = true;
  other_light_ = false;
  same_shape_ = true;
  quality_ = ReferenceQuality::fresh;
  phase_ = Phase::holding;
  averaging_ = false;
  no_contact_before_ = false;
  ReferenceStep step{.reference_changed = true, .answer = std::nullopt};
  if (std::exchange(request_, std::nullopt)) step.answer = Outcome::done;
  return step;
}

ReferenceStep ReferenceKeeper::decide(Outcome obstacle) noexcept {
  ReferenceStep step;
  averaging_ = false;
  if (phase_ != Phase::holding) {
    if (obstacle == Outcome::refused_dark) {
      phase_ = Phase::settling;
      settle_.reset();
      waited_ = 0;
    } else {
      step = use_fallback();
    }
  }
  if (std::exchange(request_, std::nullopt)) step.answer = obstacle;
  return step;
}

ReferenceStep ReferenceKeeper::use_fallback() noexcept {
  const Known known = best_known();
  // A single factor is measured best where most of the image is far from the contact: on all of it
  // (error 0.02 mm instead of 0.03 under a ball pressed 1 mm, simulated sensor).
  ContactVerdict verdict =
      same_shape_ ? check_.compare(*known.grid, now_, {}, ContactCheck::kSameShape, field_)
                  : check_.compare(*known.grid, now_, region_, ContactCheck::kAnyShape, field_);
  if (same_shape_ && verdict.explained < kMinExplained) {
    // A housing that fills most of the image is too dark to show a factor.
    verdict = check_.compare(*known.grid, now_, region_, ContactCheck::kSameShape, field_);
  }
  const bool same_light = have_good_ && good_same_light_;
  if (verdict.explained < kMinExplained) {
    // Most of the field is pressed. Under the same light the reference holds as it is.
    field_.fill(same_light ? 1.0F : std::clamp(now_.mean / known.grid->mean, 0.0625F, 16.0F));
  }
  relight(known.reference_q8, width_, height_, field_, fallback_);
  quality_ = same_light ? ReferenceQuality::restored : ReferenceQuality::stale;
  phase_ = Phase::holding;
  no_contact_before_ = false;  // contact, or motion, since
  watched_ = 0;
  clear_ = 0;
  return {.reference_changed = true, .answer = std::nullopt};
}

/// Whether the candidate may show an object although it is taken.
bool ReferenceKeeper::is_doubtful() noexcept {
  // A client that does not force says that there is no contact.
  if (request_ && !request_->force) return false;
  // A reference that was forced in contact is no witness against it.
  if (forced_) return calibration_shows_contact(candidate_grid_);
  return request_ && shows_contact(candidate_grid_);
}

float ReferenceKeeper::contact_limit() const noexcept {
  if (no_contact_before_) return kContactAfterNoContact;
  return other_light_ ? kContactUnderOtherLight : kContactDarkening;
}

bool ReferenceKeeper::shows_contact(const LumaGrid& now) noexcept {
  // One witness is enough: the last good reference may be from before a wear of the gel, the
  // calibration's from before a change of the light's shape.
  if (have_good_ &&
      check_.compare(good_grid_, now, region_, ContactCheck::kAnyShape, field_).darkening <
          contact_limit()) {
    return false;
  }
  return calibration_shows_contact(now);
}

bool ReferenceKeeper::calibration_shows_contact(const LumaGrid& now) noexcept {
  return check_.compare(*calibration_.grid, now, region_, ContactCheck::kAnyShape, field_)
             .darkening >= contact_limit();
}

ReferenceKeeper::Known ReferenceKeeper::best_known() const noexcept {
  return have_good_ ? Known{good_, &good_grid_} : calibration_;
}

}  // namespace dtact::pipeline
