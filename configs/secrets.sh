#!/bin/sh
# Creates the files of docker-compose.secure.yml, in the folder secrets/ (or MYVIEW_SECRETS).
#
#   sh configs/secrets.sh NAME CAMERA...
#
# NAME is this host's name or address for browsers and cameras on other machines. Existing files do not change:
# to add a camera, run it again with that camera's name. It needs openssl.
#
#   authority.key            signs the certificates below; keep it elsewhere, no process needs it
#   public/                  certificates: the authority's, the router's, the pulse server's, and https.pem (may be replaced by yours)
#   web/                     tokens.yaml and https.key
#   web/pulses               the best-view service's pulse password
#   router.key, bus          the router's key, and the users of the bus: name:password
#   sync.key, pulses         the pulse server's key, and the users of the pulses: name:password
#   cameras/ID/bus, pulses   a camera's passwords
#   cameras/ID/token         a token for its health check
set -eu
[ $# -ge 2 ] || { sed -n '2,7s/^# \{0,1\}//p' "$0" >&2; exit 2; }
command -v openssl > /dev/null || { echo "secrets.sh: needs openssl, which is not there" >&2; exit 1; }
name=$1
shift
case $name in
    *:*) also=IP:$name ;;
    *[!0-9.]*) also=DNS:$name ;;
    *) also=IP:$name ;;
esac

for camera in "$@"; do
    case $camera in
        '' | bestview | bestview-* | [!A-Za-z0-9]* | *[!A-Za-z0-9_-]*)
            echo "$0: '$camera' cannot be a camera's name: letters, digits, _ and - alone, and not bestview" >&2
            exit 2 ;;
    esac
done

# Closed to other users of the host; inside, the containers' user may read its files.
umask 022
folder=${MYVIEW_SECRETS:-secrets}
mkdir -p "$folder"
chmod 700 "$folder"
cd "$folder"
mkdir -p public web cameras

# certify WORDS: run openssl, with output only on failure
certify() {
    openssl "$@" 2> log || { cat log >&2; rm log; exit 1; }
    rm log
}

# pair FILE KEY NAMES: create a key and a certificate of the authority
pair() {
    [ ! -e "$1" ] || return 0
    certify req -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -subj "/CN=$name" -out request -keyout "$2"
    printf 'subjectAltName=%s\nextendedKeyUsage=serverAuth\n' "$3" > names
    certify x509 -req -in request -CA public/authority.pem -CAkey authority.key -CAcreateserial -CAserial serial \
        -days 825 -extfile names -out "$1"
    rm request names
    chmod 444 "$2"
}

# token NAME ROLE: add a line to tokens.yaml and print the token
token() {
    made=$(openssl rand -base64 32 | tr '+/' '-_' | tr -d '=\n')
    hash=$(printf %s "$made" | openssl dgst -sha256 -r | cut -d ' ' -f 1)
    printf '  - {name: "%s", sha256: "%s", %s, made: "%s"}\n' \
        "$1" "$hash" "$2" "$(date -u +%Y-%m-%dT%H:%M:%SZ)" >> web/tokens.yaml
    printf '%s\n' "$made"
}

# password NAME ALL OWN: add a line name:password to the common file and write it to its own file
password() {
    [ ! -e "$3" ] || return 0
    printf '%s:%s\n' "$1" "$(openssl rand -hex 32)" | tee -a "$2" > "$3"
}

if [ ! -e public/authority.pem ]; then
    certify req -x509 -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -days 3650 -subj "/CN=MyView authority" \
        -out public/authority.pem -keyout authority.key
    chmod 400 authority.key
fi
pair public/router.pem router.key "$also,DNS:bestview"
pair public/sync.pem sync.key "$also,DNS:sync"
pair public/https.pem web/https.key "$also"
password bestview pulses web/pulses
if [ ! -e web/tokens.yaml ]; then
    echo 'tokens:' > web/tokens.yaml
    echo "Operator token (not stored): $(token operator 'role: operate')"
fi
for camera in "$@"; do
    mkdir -p "cameras/$camera"
    password "$camera" bus "cameras/$camera/bus"
    password "$camera" pulses "cameras/$camera/pulses"
    [ -e "cameras/$camera/token" ] || token "health of $camera" "role: watch, camera: $camera" > "cameras/$camera/token"
done
