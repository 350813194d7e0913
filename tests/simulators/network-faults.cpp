/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "network-faults.hpp"

#include <algorithm>
#include <charconv>

NetworkFaults::NetworkFaults (const FaultSettings &settings)
    : settings_ (settings), random_ (settings.seed)
{
}

void
NetworkFaults::set (const FaultSettings &settings)
{
  settings_ = settings;
  burst_left_ = 0;
}

/* Not std::bernoulli_distribution, whose results differ between libraries. */
bool
NetworkFaults::chance (double share)
{
  return double (random_ () >> 11) * 0x1p-53 < share;
}

bool
NetworkFaults::is_lost ()
{
  if (burst_left_ > 0) {
    burst_left_--;
    return true;
  }
  /* The share of packets that begin a burst, so that the total loss is as configured. */
  const double begins =
      settings_.loss >= 1
          ? 1
          : settings_.loss / (settings_.burst * (1 - settings_.loss) + settings_.loss);
  if (!chance (settings_.loss > 0 ? begins : 0))
    return false;
  burst_left_ = settings_.burst - 1;
  return true;
}

void
NetworkFaults::enter (std::span<const uint8_t> bytes, int64_t due_ns, bool held_back)
{
  Packet packet;
  if (!spare_.empty ()) {
    packet = std::move (spare_.back ());
    spare_.pop_back ();
  }
  packet.bytes.assign (bytes.begin (), bytes.end ());
  packet.order = ++entered_;
  packet.due_ns = held_back ? due_ns + kHoldNs : due_ns;
  packet.after_order = held_back ? packet.order + uint64_t (settings_.reorder_by) : 0;
  waiting_.push_back (std::move (packet));
}

void
NetworkFaults::offer (std::span<const uint8_t> packet, int64_t now_ns)
{
  counters_.in++;
  if (is_lost ()) {
    counters_.lost++;
    return;
  }
  int64_t due_ns = now_ns;
  if (settings_.bandwidth_bps > 0) {
    line_free_ns_ = std::max (line_free_ns_, now_ns);
    if (line_free_ns_ - now_ns > kQueueNs) {
      counters_.congested++;
      return;
    }
    line_free_ns_ += int64_t (double (packet.size ()) * 8e9 / settings_.bandwidth_bps);
    due_ns = line_free_ns_;
  }
  due_ns += settings_.delay_ns;
  if (settings_.jitter_ns > 0)
    due_ns += int64_t (random_ () % uint64_t (settings_.jitter_ns + 1));
  const bool held_back = settings_.reorder > 0 && chance (settings_.reorder);
  counters_.held_back += held_back;
  enter (packet, due_ns, held_back);
  if (settings_.duplicate > 0 && chance (settings_.duplicate)) {
    counters_.duplicated++;
    enter (packet, due_ns, false);
  }
}

std::size_t
NetworkFaults::first () const
{
  std::size_t best = waiting_.size ();
  for (std::size_t i = 0; i < waiting_.size (); i++) {
    if (best == waiting_.size () || waiting_[i].due_ns < waiting_[best].due_ns ||
        (waiting_[i].due_ns == waiting_[best].due_ns && waiting_[i].order < waiting_[best].order))
      best = i;
  }
  return best;
}

std::optional<std::span<const uint8_t>>
NetworkFaults::take (int64_t now_ns)
{
  const std::size_t i = first ();
  if (i == waiting_.size () || waiting_[i].due_ns > now_ns)
    return {};
  spare_.push_back (std::move (leaving_));
  leaving_ = std::move (waiting_[i]);
  waiting_[i] = std::move (waiting_.back ());
  waiting_.pop_back ();
  for (Packet &packet : waiting_) /* those that were held back until this one */
    if (packet.after_order && leaving_.order >= packet.after_order) {
      packet.due_ns = std::min (packet.due_ns, now_ns);
      packet.after_order = 0;
    }
  counters_.out++;
  return leaving_.bytes;
}

std::optional<int64_t>
NetworkFaults::due_ns () const
{
  const std::size_t i = first ();
  return i == waiting_.size () ? std::nullopt : std::optional (waiting_[i].due_ns);
}

/* ---- options ---- */

const char *const kFaultOptions =
    "  --loss SHARE       share of packets that are lost, 0 to 1 (default 0)\n"
    "  --burst N          packets lost in a row at each loss (default 1)\n"
    "  --duplicate SHARE  share of packets that are duplicated (default 0)\n"
    "  --reorder SHARE    share of packets that are held back (default 0)\n"
    "  --reorder-by N     until N later packets have passed, or for 100 ms (default 10)\n"
    "  --delay MS         delay of every packet (default 0)\n"
    "  --jitter MS        random extra delay, uniform from 0; reorders packets (default 0)\n"
    "  --bandwidth KBIT   1,000 bits per second; packets that would wait for more than 200 ms are "
    "lost\n"
    "                     (default 0: no limit)\n"
    "  --seed N           seed of the random numbers (default 1)\n";

namespace {

bool
read_real (const std::string &text, double &value)
{
  const auto [end, error] = std::from_chars (text.data (), text.data () + text.size (), value);
  return error == std::errc{} && end == text.data () + text.size ();
}

} // namespace

bool
read_fault_option (const std::string &name, const std::string &value, FaultSettings &settings,
    std::string &problem)
{
  double number = 0;
  const auto real = [&] (double most, const char *what) {
    const bool good = read_real (value, number) && number >= 0 && number <= most;
    problem = good ? "" : what;
    return good;
  };
  const auto share = [&] (double &to) {
    if (real (1, "a share from 0 to 1"))
      to = number;
  };
  const auto whole = [&] (int &to) {
    if (real (100000, "a whole number from 1 to 100000") && number == int (number) && number >= 1)
      to = int (number);
    else
      problem = "a whole number from 1 to 100000";
  };
  const auto time = [&] (int64_t &to) {
    if (real (10000, "milliseconds from 0 to 10000"))
      to = int64_t (number * 1e6);
  };
  if (name == "--loss")
    share (settings.loss);
  else if (name == "--duplicate")
    share (settings.duplicate);
  else if (name == "--reorder")
    share (settings.reorder);
  else if (name == "--burst")
    whole (settings.burst);
  else if (name == "--reorder-by")
    whole (settings.reorder_by);
  else if (name == "--delay")
    time (settings.delay_ns);
  else if (name == "--jitter")
    time (settings.jitter_ns);
  else if (name == "--bandwidth") {
    if (real (1e9, "kbit/s from 0 to 1000000000"))
      settings.bandwidth_bps = number * 1000;
  } else if (name == "--seed") {
    if (real (1e15, "a number from 0"))
      settings.seed = uint64_t (number);
  } else
    return false;
  return true;
}
