/* SPDX-License-Identifier: LGPL-2.1-or-later */
#include "gige-description.hpp"

#include <glib/gstdio.h>
#include <unistd.h>

#include "gige-packets.hpp"

namespace {

std::string
hex (std::uint32_t value)
{
  gchar text[16];
  g_snprintf (text, sizeof text, "0x%x", value);
  return text;
}

std::string
register_node (const std::string &name, std::uint32_t address)
{
  return "<IntReg Name=\"" + name + "\" NameSpace=\"Custom\"><Address>" + hex (address) +
         "</Address><Length>4</Length><AccessMode>RW</AccessMode><pPort>Device</pPort>"
         "<Sign>Unsigned</Sign><Endianess>BigEndian</Endianess></IntReg>\n";
}

/* Bit 0 is the highest one. */
std::string
bit_node (const std::string &name, std::uint32_t address, int bit)
{
  return "<MaskedIntReg Name=\"" + name + "\" NameSpace=\"Custom\"><Address>" + hex (address) +
         "</Address><Length>4</Length><AccessMode>RW</AccessMode><pPort>Device</pPort><Bit>" +
         std::to_string (bit) +
         "</Bit><Sign>Unsigned</Sign><Endianess>BigEndian</Endianess></MaskedIntReg>\n";
}

std::string
integer_node (const std::string &name, std::uint32_t address)
{
  return "<Integer Name=\"" + name + "\" NameSpace=\"Standard\"><pValue>" + name +
         "Register</pValue><Min>0</Min><Max>4294967295</Max></Integer>\n" +
         register_node (name + "Register", address);
}

std::string
entry (const std::string &name, std::uint32_t value)
{
  return "<EnumEntry Name=\"" + name + "\" NameSpace=\"Standard\"><Value>" +
         std::to_string (value) + "</Value></EnumEntry>\n";
}

std::string
enumeration_node (const std::string &name, std::uint32_t address, const std::string &entries)
{
  return "<Enumeration Name=\"" + name + "\" NameSpace=\"Standard\">" + entries + "<pValue>" +
         name + "Register</pValue></Enumeration>\n" + register_node (name + "Register", address);
}

/* The output line is wired and on, whatever these say. */
std::string
line_features ()
{
  return enumeration_node ("LineSelector", 0x410, entry ("Line1", 1) + entry ("Line2", 2)) +
         enumeration_node ("LineMode", 0x414, entry ("Input", 0) + entry ("Output", 1)) +
         enumeration_node ("LineSource", 0x418, entry ("Off", 0) + entry ("ExposureActive", 1));
}

std::string
balance_features ()
{
  return enumeration_node ("BalanceRatioSelector", kRegisterBalanceSelector,
             entry ("Red", 0) + entry ("Green", 1) + entry ("Blue", 2)) +
         "<Float Name=\"BalanceRatio\" NameSpace=\"Standard\"><pValue>BalanceRatioRegister</pValue>"
         "<Min>0.1</Min><Max>16</Max></Float>\n<FloatReg Name=\"BalanceRatioRegister\" "
         "NameSpace=\"Custom\"><Address>" +
         hex (kRegisterBalanceRatio) +
         "</Address><pIndex Offset=\"4\">BalanceRatioSelectorRegister</pIndex><Length>4</Length>"
         "<AccessMode>RW</AccessMode><pPort>Device</pPort><Endianess>BigEndian</Endianess>"
         "</FloatReg>\n";
}

/* They can be set and read; the pictures stay the same. */
std::string
look_features ()
{
  const std::string modes = entry ("Off", 0) + entry ("Once", 1) + entry ("Continuous", 2);
  return enumeration_node ("ExposureAuto", 0x420, modes) +
         enumeration_node ("BalanceWhiteAuto", 0x424, modes) + balance_features ();
}

std::string
more_features ()
{
  return line_features () + look_features () +
         integer_node ("ActionDeviceKey", kRegisterActionDeviceKey) +
         integer_node ("ActionGroupKey", kRegisterActionGroupKey) +
         integer_node ("ActionGroupMask", kRegisterActionGroupMask) +
         "<Boolean Name=\"GevSCPSFireTestPacket\" NameSpace=\"Standard\">"
         "<pValue>FireTestPacketRegister</pValue><OnValue>1</OnValue><OffValue>0</OffValue>"
         "</Boolean>\n" +
         bit_node ("FireTestPacketRegister", kRegisterPacketSize, 0) +
         "<Boolean Name=\"GevSCPSDoNotFragment\" NameSpace=\"Standard\">"
         "<pValue>DoNotFragmentRegister</pValue><OnValue>1</OnValue><OffValue>0</OffValue>"
         "</Boolean>\n" +
         bit_node ("DoNotFragmentRegister", kRegisterPacketSize, 1);
}

/* Puts text before the first `mark` behind `from`. */
void
insert (std::string &xml, const std::string &from, const std::string &mark, const std::string &text)
{
  const std::size_t at = xml.find (from);
  const std::size_t before = at == xml.npos ? at : xml.find (mark, at + from.size ());
  if (before != xml.npos)
    xml.insert (before, text);
}

std::string
description ()
{
  ArvFakeCamera *plain = arv_fake_camera_new ("plain");
  size_t size = 0;
  const char *text = arv_fake_camera_get_genicam_xml (plain, &size);
  std::string xml (text, size);
  g_object_unref (plain);
  insert (xml, "<Enumeration Name=\"TriggerSource\"", "<EnumEntry",
      entry ("Action1", kTriggerByAction) + entry ("Line1", kTriggerByLine1));
  insert (xml, "<Category Name=\"TransportLayerControl\"", "<pFeature",
      "<pFeature>ActionDeviceKey</pFeature><pFeature>ActionGroupKey</pFeature>"
      "<pFeature>ActionGroupMask</pFeature>\n");
  insert (
      xml, "<Category Name=\"TransportLayerControl\"", "<Port Name=\"Device\"", more_features ());
  return xml;
}

} // namespace

ArvFakeCamera *
make_fake_camera (const std::string &serial)
{
  static const std::string xml = description ();
  gchar *path = nullptr;
  const int file = g_file_open_tmp ("fake-camera-XXXXXX.xml", &path, nullptr);
  const bool written = file >= 0 && write (file, xml.data (), xml.size ()) == ssize_t (xml.size ());
  ArvFakeCamera *camera = arv_fake_camera_new_full (serial.c_str (), written ? path : nullptr);
  if (file >= 0) {
    close (file);
    g_unlink (path);
  }
  g_free (path);
  return camera;
}
