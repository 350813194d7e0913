/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "gige-camera.hpp"

#include <arpa/inet.h>
#include <poll.h>
#include <pthread.h>
#include <sys/eventfd.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <bit>
#include <cstring>

#include "gige-description.hpp"

namespace {

using rangecast::Status;
using rangecast::StatusCode;

constexpr std::int64_t kSecond = 1000000000;
constexpr std::size_t kFramesKept = 4;

} // namespace

struct GigeCamera::Frame {
  GvspPicture picture;
  std::vector<std::uint8_t> pixels;
  std::uint32_t chunk = 0; /* bytes of a data packet */

  [[nodiscard]] std::uint32_t data_packets () const
  {
    return std::uint32_t ((pixels.size () + chunk - 1) / chunk);
  }
};

namespace {

std::int64_t
now ()
{
  timespec time;
  clock_gettime (CLOCK_MONOTONIC, &time);
  return time.tv_sec * kSecond + time.tv_nsec;
}

/* A camera's hardware answers at once, whatever else this machine does. Where the user may not have
 * that (RLIMIT_RTPRIO), the thread is one as any other. */
void
set_at_once (bool at_once)
{
  const sched_param priority = {at_once ? 10 : 0};
  pthread_setschedparam (pthread_self (), at_once ? SCHED_RR : SCHED_OTHER, &priority);
}

sockaddr_in
make_address (const std::string &address, std::uint16_t port)
{
  sockaddr_in result{};
  result.sin_family = AF_INET;
  result.sin_port = htons (port);
  inet_pton (AF_INET, address.c_str (), &result.sin_addr);
  return result;
}

bool
is_same (const sockaddr_in &a, const sockaddr_in &b)
{
  return a.sin_port == b.sin_port && a.sin_addr.s_addr == b.sin_addr.s_addr;
}

} // namespace

/* ---- life ---- */

GigeCamera::GigeCamera (const GigeCameraSettings &settings, Scenery scenery)
    : settings_ (settings), scenery_ (std::move (scenery)), born_ns_ (now ()),
      frames_ (kFramesKept), random_ (settings.seed)
{
}

GigeCamera::~GigeCamera ()
{
  ending_ = true;
  if (wake_ >= 0)
    eventfd_write (wake_, 1);
  if (thread_.joinable ())
    thread_.join ();
  for (int fd : {control_, stream_, wake_})
    if (fd >= 0)
      close (fd);
  g_clear_object (&registers_);
}

namespace {

int
bound_socket (const std::string &address, std::uint16_t port)
{
  const int fd = socket (AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const sockaddr_in local = make_address (address, port);
  if (fd >= 0 && bind (fd, reinterpret_cast<const sockaddr *> (&local), sizeof local) != 0) {
    const int why = errno;
    close (fd);
    errno = why;
    return -1;
  }
  return fd;
}

} // namespace

Status
GigeCamera::open_sockets ()
{
  control_ = bound_socket (settings_.address, kGvcpPort);
  if (control_ >= 0)
    stream_ = bound_socket (settings_.address, 0);
  if (stream_ >= 0)
    wake_ = eventfd (0, EFD_CLOEXEC | EFD_NONBLOCK);
  if (wake_ >= 0)
    return {};
  const char *why =
      errno == EADDRINUSE
          ? "another camera or program is there (UDP port 3956); stop it or use another address"
      : errno == EADDRNOTAVAIL ? "not an address of this machine"
                               : std::strerror (errno);
  return {StatusCode::kBadValue,
      "camera " + settings_.serial + " at " + settings_.address + ": " + why};
}

Status
GigeCamera::create (
    const GigeCameraSettings &settings, Scenery scenery, std::unique_ptr<GigeCamera> &camera)
{
  std::unique_ptr<GigeCamera> made (new GigeCamera (settings, std::move (scenery)));
  if (Status s = made->open_sockets (); !s.ok ())
    return s;
  made->registers_ = make_fake_camera (settings.serial);
  made->fill_registers ();
  camera = std::move (made);
  return {};
}

void
GigeCamera::fill_registers ()
{
  const auto text = [&] (std::uint32_t address, std::size_t size, const char *value) {
    std::vector<char> field (size);
    std::strncpy (field.data (), value, size - 1);
    arv_fake_camera_write_memory (registers_, address, guint32 (size), field.data ());
  };
  text (kRegisterManufacturer, 32, "rangecast");
  text (kRegisterModel, 32, "scene");
  text (kRegisterUserName, 16, settings_.serial.c_str ());
  const std::uint32_t ip = ntohl (make_address (settings_.address, 0).sin_addr.s_addr);
  set (kRegisterCurrentIp, ip);
  set (kRegisterMacHigh, 0x0200); /* one of those that anybody may use */
  set (kRegisterMacLow, ip);
  set (kRegisterActionSignals, 1);
  for (std::uint32_t colour = 0; colour < 3; colour++)
    set (kRegisterBalanceRatio + 4 * colour, std::bit_cast<std::uint32_t> (1.0f));
  sockaddr_in source{};
  socklen_t source_size = sizeof source;
  getsockname (stream_, reinterpret_cast<sockaddr *> (&source), &source_size);
  set (kRegisterStreamSourcePort, ntohs (source.sin_port));
  set (kRegisterGvcpCapability,
      settings_.resend ? 0x47 : 0x43); /* action, resend, writemem, several */
  set (ARV_FAKE_CAMERA_REGISTER_SENSOR_WIDTH, std::uint32_t (settings_.width));
  set (ARV_FAKE_CAMERA_REGISTER_SENSOR_HEIGHT, std::uint32_t (settings_.height));
  set (ARV_FAKE_CAMERA_REGISTER_WIDTH, std::uint32_t (settings_.width));
  set (ARV_FAKE_CAMERA_REGISTER_HEIGHT, std::uint32_t (settings_.height));
  set (ARV_FAKE_CAMERA_REGISTER_PIXEL_FORMAT, settings_.pixel_format);
  set (ARV_FAKE_CAMERA_REGISTER_ACQUISITION_FRAME_PERIOD_US,
      std::uint32_t (1e6 / settings_.fps + 0.5));
  discovery_data_.resize (kDiscoveryBytes);
  arv_fake_camera_read_memory (registers_, 0, kDiscoveryBytes, discovery_data_.data ());
}

void
GigeCamera::start ()
{
  thread_ = std::thread ([this] { run (); });
}

/* ---- registers ---- */

std::uint32_t
GigeCamera::get (std::uint32_t address) const
{
  std::uint32_t value = 0;
  arv_fake_camera_read_register (registers_, address, &value);
  return value;
}

void
GigeCamera::set (std::uint32_t address, std::uint32_t value)
{
  arv_fake_camera_write_register (registers_, address, value);
}

bool
GigeCamera::is_triggered_by (std::uint32_t source) const
{
  return get (ARV_FAKE_CAMERA_REGISTER_TRIGGER_MODE) == 1 &&
         get (ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOURCE) == source;
}

std::int64_t
GigeCamera::frame_period_ns () const
{
  const std::int64_t us = get (ARV_FAKE_CAMERA_REGISTER_ACQUISITION_FRAME_PERIOD_US);
  return std::clamp<std::int64_t> (us, 1000, 10000000) * 1000;
}

/* It counts from when the camera was switched on. */
std::uint64_t
GigeCamera::camera_time (std::int64_t now_ns) const
{
  return std::uint64_t (now_ns - born_ns_);
}

bool
GigeCamera::may_write (const sockaddr_in &from) const
{
  return get (kRegisterControl) == 0 || is_same (from, controller_);
}

void
GigeCamera::set_acquisition (bool running)
{
  set (ARV_FAKE_CAMERA_REGISTER_ACQUISITION, running);
  if (running == acquiring_)
    return;
  acquiring_ = running;
  next_frame_ns_ = 0;
  for (Frame &frame : frames_)
    frame.picture.block_id = 0;
  scenery_.acquisition (running);
}

/* What a register does when it is written. */
void
GigeCamera::wrote (std::uint32_t address, std::uint32_t value, const sockaddr_in &from)
{
  switch (address) {
    case kRegisterControl:
      heard_ns_ = now ();
      if (value != 0)
        controller_ = from;
      else
        set_acquisition (false);
      break;
    case kRegisterPacketSize:
      if (value & 0x80000000) /* send one now */
        send_test_packet (value & 0xffff);
      set (address, value & 0x7fffffff);
      break;
    case kRegisterTimestampControl:
      if (value & 2) {
        const std::uint64_t time = camera_time (now ());
        set (kRegisterTimestampHigh, std::uint32_t (time >> 32));
        set (kRegisterTimestampLow, std::uint32_t (time));
      }
      break;
    case ARV_FAKE_CAMERA_REGISTER_ACQUISITION:
      set_acquisition (value != 0);
      break;
    case ARV_FAKE_CAMERA_REGISTER_TRIGGER_SOFTWARE:
      set (address, 0);
      if (value != 0 && is_triggered_by (kTriggerBySoftware))
        expose (now ());
      break;
    default:
      break;
  }
  std::lock_guard guard (lock_);
  device_key_ = get (kRegisterActionDeviceKey);
  group_key_ = get (kRegisterActionGroupKey);
  group_mask_ = get (kRegisterActionGroupMask);
}

/* ---- control: GVCP ---- */

void
GigeCamera::answer (const sockaddr_in &to, PacketWriter ack) const
{
  sendto (control_, ack.bytes ().data (), ack.bytes ().size (), MSG_DONTWAIT,
      reinterpret_cast<const sockaddr *> (&to), sizeof to);
}

void
GigeCamera::refuse (const GvcpCommand &command, const sockaddr_in &to, GvcpStatus status) const
{
  if (command.wants_ack ())
    answer (to, gvcp_ack (command, status, 0));
}

void
GigeCamera::read_registers (const GvcpCommand &command, const sockaddr_in &from)
{
  const std::size_t bytes = command.data.size () / 4 * 4;
  PacketWriter ack = gvcp_ack (command, GvcpStatus::kSuccess, bytes);
  for (std::size_t i = 0; i < bytes; i += 4) {
    const std::uint32_t address = read_u32 (&command.data[i]);
    if (address % 4 != 0 || address >= ARV_FAKE_CAMERA_MEMORY_SIZE - 4)
      return refuse (command, from, GvcpStatus::kInvalidAddress);
    ack.u32 (get (address));
  }
  answer (from, std::move (ack));
}

/* The acknowledge goes first: what the last register does, such as a picture, takes its time. */
void
GigeCamera::write_registers (const GvcpCommand &command, const sockaddr_in &from)
{
  if (!may_write (from))
    return refuse (command, from, GvcpStatus::kAccessDenied);
  const std::size_t count = command.data.size () / 8;
  for (std::size_t i = 0; i < count; i++) {
    const std::uint32_t address = read_u32 (&command.data[8 * i]);
    if (address % 4 != 0 || address >= ARV_FAKE_CAMERA_MEMORY_SIZE - 4)
      return refuse (command, from, GvcpStatus::kInvalidAddress);
  }
  if (command.wants_ack ()) {
    PacketWriter ack = gvcp_ack (command, GvcpStatus::kSuccess, 4);
    answer (from, ack.u16 (0).u16 (std::uint16_t (count)));
  }
  for (std::size_t i = 0; i < count; i++) {
    const std::uint32_t address = read_u32 (&command.data[8 * i]),
                        value = read_u32 (&command.data[8 * i + 4]);
    set (address, value);
    wrote (address, value, from);
  }
}

void
GigeCamera::read_memory (const GvcpCommand &command, const sockaddr_in &from)
{
  if (command.data.size () < 8)
    return refuse (command, from, GvcpStatus::kInvalidParameter);
  const std::uint32_t address = read_u32 (&command.data[0]);
  const std::uint16_t count = read_u16 (&command.data[6]);
  size_t xml_bytes = 0;
  arv_fake_camera_get_genicam_xml (registers_, &xml_bytes);
  const std::uint64_t end = std::uint64_t (address) + count,
                      memory_end = ARV_FAKE_CAMERA_MEMORY_SIZE + (xml_bytes + 3) / 4 * 4;
  if (count == 0 || count > kMaxGvcpBytes || address % 4 != 0 || end > memory_end)
    return refuse (command, from, GvcpStatus::kInvalidAddress);
  PacketWriter ack = gvcp_ack (command, GvcpStatus::kSuccess, 4u + count);
  ack.u32 (address).zeros (count);
  arv_fake_camera_read_memory (registers_, address, count, ack.bytes ().data () + 12);
  answer (from, std::move (ack));
}

void
GigeCamera::write_memory (const GvcpCommand &command, const sockaddr_in &from)
{
  if (!may_write (from))
    return refuse (command, from, GvcpStatus::kAccessDenied);
  if (command.data.size () <= 4)
    return refuse (command, from, GvcpStatus::kInvalidParameter);
  const std::uint32_t address = read_u32 (&command.data[0]);
  const std::size_t count = command.data.size () - 4;
  if (address % 4 != 0 || address + count >= ARV_FAKE_CAMERA_MEMORY_SIZE)
    return refuse (command, from, GvcpStatus::kInvalidAddress);
  arv_fake_camera_write_memory (registers_, address, guint32 (count), &command.data[4]);
  if (command.wants_ack ())
    answer (from, gvcp_ack (command, GvcpStatus::kSuccess, 4).u32 (std::uint32_t (count)));
  for (std::size_t i = 0; i + 4 <= count; i += 4)
    wrote (std::uint32_t (address + i), read_u32 (&command.data[4 + i]), from);
}

void
GigeCamera::handle (const GvcpCommand &command, const sockaddr_in &from)
{
  if (is_same (from, controller_))
    heard_ns_ = now ();
  switch (Gvcp (command.command)) {
    case Gvcp::kDiscovery:
      return answer_discovery (command, from);
    case Gvcp::kReadRegister:
      return read_registers (command, from);
    case Gvcp::kWriteRegister:
      write_registers (command, from);
      if (is_same (from, controller_))
        heard_ns_ = now ();
      return;
    case Gvcp::kReadMemory:
      return read_memory (command, from);
    case Gvcp::kWriteMemory:
      return write_memory (command, from);
    case Gvcp::kPacketResend:
      return send_again (command);
    case Gvcp::kAction:
      return handle_action (command, from);
    default:
      return refuse (command, from, GvcpStatus::kNotImplemented);
  }
}

void
GigeCamera::answer_discovery (const GvcpCommand &command, const sockaddr_in &from)
{
  PacketWriter ack = gvcp_ack (command, GvcpStatus::kSuccess, discovery_data_.size ());
  ack.bytes ().insert (ack.bytes ().end (), discovery_data_.begin (), discovery_data_.end ());
  answer (from, std::move (ack));
}

void
GigeCamera::handle_action (const GvcpCommand &command, const sockaddr_in &from)
{
  ActionCommand action;
  if (!parse_action (command, action))
    return refuse (command, from, GvcpStatus::kInvalidParameter);
  {
    std::lock_guard guard (lock_);
    if (action.device_key != device_key_ || action.group_key != group_key_ ||
        (action.group_mask & group_mask_) == 0)
      return; /* meant for other cameras: no answer either */
  }
  action_ = true;
  eventfd_write (wake_, 1);
  if (command.wants_ack ())
    answer (from, gvcp_ack (command, GvcpStatus::kSuccess, 0));
}

void
GigeCamera::line_rises ()
{
  line_ = true;
  eventfd_write (wake_, 1);
}

void
GigeCamera::regulate (std::uint32_t address, std::uint32_t value)
{
  {
    std::lock_guard guard (lock_);
    regulated_.emplace_back (address, value);
  }
  eventfd_write (wake_, 1);
}

/* ---- the camera's thread ---- */

void
GigeCamera::receive ()
{
  std::uint8_t packet[2048];
  sockaddr_in from{};
  socklen_t size = sizeof from;
  const ssize_t got = recvfrom (
      control_, packet, sizeof packet, MSG_DONTWAIT, reinterpret_cast<sockaddr *> (&from), &size);
  GvcpCommand command;
  if (got > 0 && parse_gvcp ({packet, std::size_t (got)}, command))
    handle (command, from);
}

/* A controller that was not heard for longer than its heartbeat is gone. */
void
GigeCamera::check_heartbeat (std::int64_t now_ns)
{
  const std::int64_t timeout_ns = std::int64_t (get (kRegisterHeartbeat)) * 1000000;
  if (get (kRegisterControl) == 0 || now_ns - heard_ns_ <= timeout_ns)
    return;
  set (kRegisterControl, 0);
  set_acquisition (false);
}

void
GigeCamera::drain_wake_ups (std::int64_t now_ns)
{
  {
    std::lock_guard guard (lock_);
    for (const auto &[address, value] : regulated_)
      set (address, value);
    regulated_.clear ();
  }
  const bool by_action = action_.exchange (false) && is_triggered_by (kTriggerByAction);
  const bool by_line = line_.exchange (false) &&
                       (is_triggered_by (kTriggerByLine) || is_triggered_by (kTriggerByLine1));
  if (by_action || by_line)
    expose (now_ns);
}

std::int64_t
GigeCamera::next_wake (std::int64_t now_ns)
{
  std::int64_t next = now_ns + kSecond / 10; /* heartbeat */
  if (acquiring_ && get (ARV_FAKE_CAMERA_REGISTER_TRIGGER_MODE) == 0) {
    const std::int64_t period = frame_period_ns ();
    if (next_frame_ns_ == 0 || next_frame_ns_ > now_ns + period)
      next_frame_ns_ = (now_ns / period + 1) * period;
    next = std::min (next, next_frame_ns_);
  }
  return next;
}

void
GigeCamera::run ()
{
  prctl (PR_SET_TIMERSLACK, 1000UL);
  set_at_once (true);
  pollfd fds[] = {{control_, POLLIN, 0}, {wake_, POLLIN, 0}};
  while (!ending_) {
    std::int64_t time = now ();
    const std::int64_t wait = std::max<std::int64_t> (next_wake (time) - time, 0);
    const timespec timeout = {wait / kSecond, wait % kSecond};
    const int ready = ppoll (fds, 2, &timeout, nullptr);
    if (ready > 0 && (fds[0].revents & POLLIN))
      receive ();
    eventfd_t ignored;
    if (ready > 0 && (fds[1].revents & POLLIN))
      eventfd_read (wake_, &ignored);
    time = now ();
    drain_wake_ups (time);
    if (acquiring_ && next_frame_ns_ != 0 && next_frame_ns_ <= time) {
      const std::int64_t due = next_frame_ns_, period = frame_period_ns ();
      next_frame_ns_ = (time / period + 1) * period;
      if (get (ARV_FAKE_CAMERA_REGISTER_TRIGGER_MODE) == 0)
        expose (due);
    }
    check_heartbeat (time);
  }
  set_acquisition (false);
}

/* ---- pictures: GVSP ---- */

void
GigeCamera::expose (std::int64_t now_ns)
{
  const std::uint32_t format = get (ARV_FAKE_CAMERA_REGISTER_PIXEL_FORMAT),
                      size = get (kRegisterPacketSize) & 0xffff;
  const SensorRegion region = {int (get (ARV_FAKE_CAMERA_REGISTER_X_OFFSET)),
      int (get (ARV_FAKE_CAMERA_REGISTER_Y_OFFSET)), int (get (ARV_FAKE_CAMERA_REGISTER_WIDTH)),
      int (get (ARV_FAKE_CAMERA_REGISTER_HEIGHT))};
  const bool fits = region.x >= 0 && region.y >= 0 && region.width > 0 && region.height > 0 &&
                    region.width <= settings_.width - region.x &&
                    region.height <= settings_.height - region.y;
  if (!acquiring_ || !fits || bytes_per_pixel (format) == 0 || size <= kGvspOverhead)
    return;
  last_block_ = last_block_ == 65535 ? 1 : last_block_ + 1;
  scenery_.exposed (last_block_, now_ns);
  Frame &frame = frames_[last_block_ % kFramesKept];
  const std::uint64_t stamp = camera_time (now_ns + stamp_off_ns_.exchange (0));
  frame.picture = {last_block_, stamp, format, std::uint32_t (region.width),
      std::uint32_t (region.height), std::uint32_t (region.x), std::uint32_t (region.y)};
  frame.chunk = size - kGvspOverhead;
  frame.pixels.resize (
      std::size_t (region.width) * region.height * std::size_t (bytes_per_pixel (format)));
  set_at_once (false); /* to draw is not the hardware's work */
  scenery_.paint (scenery_.moment (now_ns), format, region, frame.pixels);
  set_at_once (true);
  pictures_++;
  send_frame (frame, 0, frame.data_packets () + 1);
  if (get (ARV_FAKE_CAMERA_REGISTER_ACQUISITION_MODE) == kSingleFrame)
    set_acquisition (false);
}

sockaddr_in
GigeCamera::stream_address () const
{
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_port = htons (std::uint16_t (get (kRegisterStreamPort)));
  address.sin_addr.s_addr = htonl (get (kRegisterStreamAddress));
  return address;
}

bool
GigeCamera::gets_lost ()
{
  return settings_.loss > 0 && std::uniform_real_distribution (0.0, 1.0) (random_) < settings_.loss;
}

/* As the cable does: a receiver's socket does not hold a whole picture. */
void
GigeCamera::pace (std::size_t bytes)
{
  const std::int64_t time = now ();
  paced_until_ns_ = std::max (paced_until_ns_, time) +
                    std::int64_t (double (bytes) * 8000 / settings_.link_mbits);
  const timespec until = {paced_until_ns_ / kSecond, paced_until_ns_ % kSecond};
  clock_nanosleep (CLOCK_MONOTONIC, TIMER_ABSTIME, &until, nullptr);
}

void
GigeCamera::send_frame (const Frame &frame, std::uint32_t first, std::uint32_t last)
{
  static constexpr std::uint32_t kBatch = 16;
  const std::uint32_t data_packets = frame.data_packets ();
  const std::vector<std::uint8_t> leader = gvsp_leader (frame.picture),
                                  trailer = gvsp_trailer (frame.picture, data_packets + 1);
  sockaddr_in to = stream_address ();
  std::uint8_t headers[kBatch][kGvspHeaderBytes];
  iovec parts[kBatch][2];
  mmsghdr messages[kBatch];
  const auto describe = [&] (std::uint32_t id, std::uint32_t i) -> std::size_t {
    const std::size_t begin = std::size_t (id - 1) * frame.chunk,
                      bytes = std::min<std::size_t> (frame.chunk, frame.pixels.size () - begin);
    gvsp_data_header (frame.picture.block_id, id, headers[i]);
    parts[i][0] = {headers[i], kGvspHeaderBytes};
    parts[i][1] = {const_cast<std::uint8_t *> (frame.pixels.data ()) + begin, bytes};
    return bytes + kGvspOverhead;
  };
  for (std::uint32_t id = first; id <= last && !ending_;) {
    std::uint32_t count = 0;
    std::size_t bytes = 0;
    for (; id <= last && count < kBatch; id++) {
      if (gets_lost ())
        continue;
      const auto &end = id == 0 ? leader : trailer;
      if (id > 0 && id <= data_packets)
        bytes += describe (id, count);
      else
        parts[count][0] = {const_cast<std::uint8_t *> (end.data ()), end.size ()};
      messages[count].msg_hdr = {&to, sizeof to, parts[count],
          std::size_t (id > 0 && id <= data_packets ? 2 : 1), nullptr, 0, 0};
      count++;
    }
    sendmmsg (stream_, messages, count, 0);
    pace (bytes);
  }
}

void
GigeCamera::send_again (const GvcpCommand &command)
{
  if (!settings_.resend || command.data.size () < 12)
    return;
  const std::uint16_t block = read_u16 (&command.data[2]);
  const std::uint32_t first = read_u32 (&command.data[4]) & 0xffffff,
                      last = read_u32 (&command.data[8]) & 0xffffff;
  const Frame &frame = frames_[block % kFramesKept];
  if (acquiring_ && block != 0 && frame.picture.block_id == block && first <= last &&
      last <= frame.data_packets () + 1)
    send_frame (frame, first, last);
}

void
GigeCamera::send_test_packet (std::uint32_t packet_size)
{
  static constexpr std::uint32_t kIpAndUdp = 28;
  if (packet_size <= kIpAndUdp)
    return;
  const std::vector<std::uint8_t> packet (packet_size - kIpAndUdp);
  const sockaddr_in to = stream_address ();
  sendto (stream_, packet.data (), packet.size (), MSG_DONTWAIT,
      reinterpret_cast<const sockaddr *> (&to), sizeof to);
}
