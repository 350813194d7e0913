#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Makes a certificate for web-server.sh, signed by an authority of your own that phones and browsers can trust.
set -euo pipefail
source "$(dirname "$0")/options.sh"

usage () {
  cat <<'END'
usage: web-certificate.sh FOLDER [NAME-OR-IP...]   (default: this machine's name and addresses, and localhost)
Writes FOLDER/authority.pem and authority-key.pem, once, and FOLDER/server.pem and server-key.pem for those names, for 397 days.
  web-server.sh --certificate FOLDER/server.pem --private-key FOLDER/server-key.pem --address 0.0.0.0

Browsers trust the page where authority.pem is installed as a certificate authority:
  Android   copy it there; Settings > Security > More > Encryption & credentials > Install a certificate > CA certificate
  iOS       open it; install the profile; Settings > General > About > Certificate Trust Settings: switch it on
  Firefox   Settings > Privacy & Security > Certificates > View Certificates > Authorities > Import
  Chromium  Settings > Privacy and security > Security > Manage certificates > Authorities > Import
Whoever has authority-key.pem can pretend to be any web site there: keep it safe, or delete it when all certificates are made.
END
}

case "${1:-}" in
  -h | --help) usage; exit 0 ;;
  '' | -*) usage >&2; die "expected a folder" ;;
esac
folder=$1
shift
command -v openssl >/dev/null || die "openssl is missing (Debian package openssl)"
mkdir -p "$folder" 2>/dev/null || die "cannot create '$folder'"
names=("$@")
if [ ${#names[@]} = 0 ]; then
  read -ra names <<<"$(hostname) $(hostname -I 2>/dev/null || true) localhost 127.0.0.1"
fi

alternatives=
for name in "${names[@]}"; do
  case "$name" in
    '' | *[!0-9A-Za-z.:-]*) die "expected names and IP addresses, got '$name'" ;;
    *:*) alternatives+=,IP:$name ;;
    *) if is_ipv4 "$name"; then alternatives+=,IP:$name; else alternatives+=,DNS:$name; fi ;;
  esac
done

umask 077 # for the keys
quietly () {
  "$@" 2>"$folder/openssl.log" || { cat "$folder/openssl.log" >&2; die "openssl failed"; }
  rm -f "$folder/openssl.log"
}
key=(-newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes)
if ! [ -f "$folder/authority-key.pem" ]; then
  quietly openssl req -x509 "${key[@]}" -days 3650 -subj "/CN=gst-rangecast on $(hostname)" -addext "keyUsage=critical,keyCertSign,cRLSign" \
    -keyout "$folder/authority-key.pem" -out "$folder/authority.pem"
fi
quietly openssl req "${key[@]}" -subj "/CN=${names[0]}" -keyout "$folder/server-key.pem" -out "$folder/server.csr"
printf 'basicConstraints=CA:FALSE\nkeyUsage=critical,digitalSignature\nextendedKeyUsage=serverAuth\nsubjectAltName=%s\n' "${alternatives#,}" \
  >"$folder/server.ext"
quietly openssl x509 -req -in "$folder/server.csr" -CA "$folder/authority.pem" -CAkey "$folder/authority-key.pem" -CAcreateserial -days 397 \
  -extfile "$folder/server.ext" -out "$folder/server.pem"
rm -f "$folder/server.csr" "$folder/server.ext" "$folder/authority.srl"
chmod 644 "$folder/authority.pem" "$folder/server.pem"
echo "$folder/server.pem is for ${names[*]}; install $folder/authority.pem where browsers should trust it (--help says how)"
