#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
# Makes a certificate for web-server.sh, signed by an authority of your own that phones and browsers can trust.
set -euo pipefail
source "$(dirname "$0")/options.sh"

usage () {
  cat <<'END'
usage: web-certificate.sh FOLDER [NAME-OR-IP...]   (default: this machine's name, NAME.local and IPv4 addresses, and localhost)
Writes FOLDER/authority.pem and authority-key.pem, once, and FOLDER/server.pem and server-key.pem for those names, for 397 days;
run it again then, and when the server gets another name or address. Devices need only authority.pem, once.
  web-server.sh --certificate FOLDER/server.pem --private-key FOLDER/server-key.pem --address 0.0.0.0

Browsers trust the page where authority.pem is installed as a certificate authority:
  Android   copy it there; Settings > Security > More > Encryption & credentials > Install a certificate > CA certificate
  iOS       open it; install the profile; Settings > General > About > Certificate Trust Settings: switch it on
  Firefox   Settings > Privacy & Security > Certificates > View Certificates > Authorities > Import
  Chromium  Settings > Privacy and security > Security > Manage certificates > Authorities > Import
The authority is limited to private addresses, localhost, names that end with .local, and the names and addresses that it was made with
(this machine's and those of the command line).
Whoever has authority-key.pem can pretend to be any of those to these devices, and no other web site: keep it safe, off the server if you can.
Without it no new certificate can be made: devices then need a new authority.
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
own=("$(hostname)" "$(hostname -s).local")
for name in $(hostname -I 2>/dev/null || true); do
  ! is_ipv4 "$name" || own+=("$name") # those of IPv6 change every day
done
names=("$@")
[ $# -gt 0 ] || names=("${own[@]}" localhost 127.0.0.1)

# An authority without limits could vouch for any web site. Private addresses change, so all of them are allowed.
permitted=DNS:localhost,DNS:local
for network in 127.0.0.0/255.0.0.0 10.0.0.0/255.0.0.0 172.16.0.0/255.240.0.0 192.168.0.0/255.255.0.0 169.254.0.0/255.255.0.0 \
  ::1/ffff:ffff:ffff:ffff:ffff:ffff:ffff:ffff fc00::/fe00:: fe80::/ffc0::; do
  permitted+=,IP:$network
done
alternative () { # NAME-OR-IP [MASK4 MASK6]
  case "$1" in
    *:*) echo "IP:$1${3:+/$3}" ;;
    *) if is_ipv4 "$1"; then echo "IP:$1${2:+/$2}"; else echo "DNS:$1"; fi ;;
  esac
}
alternatives=
for name in "${names[@]}"; do
  [[ "$name" =~ ^[0-9A-Za-z.:-]+$ ]] || die "expected names and IP addresses, got '$name'"
  alternatives+=,$(alternative "$name")
done
for name in "${names[@]}" "${own[@]}"; do
  permitted+=,$(alternative "$name" 255.255.255.255 ffff:ffff:ffff:ffff:ffff:ffff:ffff:ffff)
done

umask 077 # for the keys
new=$(mktemp -d "$folder/new.XXXXXX")
trap 'rm -rf "$new"' EXIT
quietly () {
  "$@" 2>"$new/openssl.log" || { cat "$new/openssl.log" >&2; die "openssl failed"; }
}
key=(-newkey ec -pkeyopt ec_paramgen_curve:prime256v1 -nodes)
authority=$folder/authority.pem authority_key=$folder/authority-key.pem
if ! [ -f "$authority" ]; then
  cat >"$new/authority.cnf" <<END
[req]
distinguished_name = name
x509_extensions = authority
[name]
[authority]
basicConstraints = critical, CA:TRUE, pathlen:0
keyUsage = critical, keyCertSign, cRLSign
subjectKeyIdentifier = hash
nameConstraints = critical, permitted;${permitted//,/, permitted;}
END
  quietly openssl req -x509 "${key[@]}" -config "$new/authority.cnf" -days 3650 -subj "/CN=gst-rangecast on $(hostname)" \
    -keyout "$new/authority-key.pem" -out "$new/authority.pem"
  chmod 644 "$new/authority.pem"
  mv "$new/authority-key.pem" "$new/authority.pem" "$folder"
fi
[ -f "$authority_key" ] || die "$authority_key is missing, and devices trust $authority: put the key back, or
remove authority.pem for a new authority, which each device must install"
quietly openssl req "${key[@]}" -subj "/CN=${names[0]}" -keyout "$new/server-key.pem" -out "$new/server.csr"
cat >"$new/server.cnf" <<END
basicConstraints = CA:FALSE
keyUsage = critical, digitalSignature
extendedKeyUsage = serverAuth
subjectKeyIdentifier = hash
authorityKeyIdentifier = keyid
subjectAltName = ${alternatives#,}
END
quietly openssl x509 -req -in "$new/server.csr" -CA "$authority" -CAkey "$authority_key" -CAserial "$new/serial" -CAcreateserial -days 397 \
  -extfile "$new/server.cnf" -out "$new/server.pem"
openssl verify -x509_strict -CAfile "$authority" "$new/server.pem" >/dev/null 2>&1 ||
  die "$authority was made for other names than ${names[*]}: name others, or remove it and its key for a new authority,
which each device must install"
chmod 644 "$new/server.pem"
mv "$new/server-key.pem" "$new/server.pem" "$folder"
echo "$folder/server.pem is for ${names[*]}; install $authority where browsers should trust it (--help says how)"
