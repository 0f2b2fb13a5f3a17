#!/bin/sh
# Makes the files that docker-compose.secure.yml hands to its services, in the folder secrets/ (or MYVIEW_SECRETS).
#
#   sh configs/secrets.sh NAME CAMERA...
#
# NAME is the name or address at which browsers, and cameras on other machines, reach this host. What is there
# already stays as it is, so that a camera can be added: run it again with that camera's name. It needs openssl.
#
#   authority.key            makes the certificates below; keep it elsewhere, no process needs it
#   public/                  certificates: the authority's, the router's, the pulse server's, and https.pem, which yours may replace
#   web/                     tokens.yaml, who may watch and operate, and https.key
#   web/pulses               the best view's own password of the pulses
#   router.key, bus          the router's key, and the users of the bus: name:password
#   sync.key, pulses         the pulse server's key, and the users of the pulses: name:password
#   cameras/ID/bus, pulses   a camera's own passwords
#   cameras/ID/token         a token to see whether it is well
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

# Nobody else of this host may look in; inside, the containers' user may read what is handed to it.
umask 022
folder=${MYVIEW_SECRETS:-secrets}
mkdir -p "$folder"
chmod 700 "$folder"
cd "$folder"
mkdir -p public web cameras

# certify WORDS: openssl, which says something only where it fails
certify() {
    openssl "$@" 2> log || { cat log >&2; rm log; exit 1; }
    rm log
}

# pair FILE KEY NAMES: a certificate of our authority
pair() {
    [ ! -e "$1" ] || return 0
    certify req -newkey ec -pkeyopt ec_paramgen_curve:P-256 -nodes -subj "/CN=$name" -out request -keyout "$2"
    printf 'subjectAltName=%s\nextendedKeyUsage=serverAuth\n' "$3" > names
    certify x509 -req -in request -CA public/authority.pem -CAkey authority.key -CAcreateserial -CAserial serial \
        -days 825 -extfile names -out "$1"
    rm request names
    chmod 444 "$2"
}

# token NAME ROLE: a line of tokens.yaml, in place; the token itself is printed
token() {
    made=$(openssl rand -base64 32 | tr '+/' '-_' | tr -d '=\n')
    hash=$(printf %s "$made" | openssl dgst -sha256 -r | cut -d ' ' -f 1)
    printf '  - {name: "%s", sha256: "%s", %s, made: "%s"}\n' \
        "$1" "$hash" "$2" "$(date -u +%Y-%m-%dT%H:%M:%SZ)" >> web/tokens.yaml
    printf '%s\n' "$made"
}

# password NAME ALL OWN: a line name:password of the file of all, and of a file of its own
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
    echo "A token to operate, which is not kept anywhere: $(token operator 'role: operate')"
fi
for camera in "$@"; do
    mkdir -p "cameras/$camera"
    password "$camera" bus "cameras/$camera/bus"
    password "$camera" pulses "cameras/$camera/pulses"
    [ -e "cameras/$camera/token" ] || token "health of $camera" "role: watch, camera: $camera" > "cameras/$camera/token"
done
