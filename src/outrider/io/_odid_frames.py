"""Where Open Drone ID messages travel: Wi-Fi beacons and NAN frames, Bluetooth 4 and 5 advertisements.

Sources: ASTM F3411-22a section 5.4 (transport), ASD-STAN prEN 4709-002, the LINKTYPE list of tcpdump, IEEE 802.11,
Wi-Fi Aware 3.2 (service descriptor), Bluetooth Core 5.3 vol. 6 B 2.3, and Nordic's sniffer protocol 2 and 3.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import Final

from outrider.io.pcap import Packet

MESSAGE: Final = 25  # bytes
PACK: Final = 0xF
BEACON, ACTION = 0x80, 0xD0  # 802.11 frame control
VENDOR_ELEMENT: Final = 0xDD
WIFI_ODID: Final = b"\xfa\x0b\xbc\x0d"  # ASTM's OUI and its type
NAN: Final = b"\x04\x09\x50\x6f\x9a\x13"  # public action, vendor, Wi-Fi Alliance, NAN
NAN_SERVICE: Final = b"\x88\x69\x19\x9d\x92\x09"  # hash of org.opendroneid.remoteid
SERVICE_DESCRIPTOR: Final = 3
ADVERTISING: Final = b"\xd6\xbe\x89\x8e"  # access address
BLUETOOTH_ODID: Final = b"\x16\xfa\xff\x0d"  # service data, 16-bit UUID 0xFFFA, application Open Drone ID
EXTENDED: Final = 7  # PDU type ADV_EXT_IND and its auxiliaries
CODED: Final = 2  # PHY in the sniffer's flags
CHECKED: Final = 1  # in the flags: the checksum was right

Found = tuple[bytes, bytes]  # who sent it (6 bytes), one message or a pack of them


def found_in(packet: Packet) -> Iterator[Found]:
    """What a packet carries of Open Drone ID, with its sender's address."""
    unwrap = LINKS.get(packet.link)
    return unwrap(packet.data) if unwrap is not None else iter(())


def messages(found: bytes) -> Iterator[bytes]:
    """The single messages of 25 bytes in one, or in a pack of them."""
    if len(found) >= 3 and found[0] >> 4 == PACK:
        size, count = found[1], found[2]
        body = found[3:]
        parts = [body[k * MESSAGE : (k + 1) * MESSAGE] for k in range(count)] if size == MESSAGE else []
        yield from (p for p in parts if len(p) == MESSAGE)
    elif len(found) >= MESSAGE:
        yield found[:MESSAGE]


def _radiotap(data: bytes) -> Iterator[Found]:
    return _wifi(data[int.from_bytes(data[2:4], "little") :]) if len(data) > 4 else iter(())


def _wifi(frame: bytes) -> Iterator[Found]:
    if len(frame) < 30:
        return iter(())
    sender = frame[10:16]
    if frame[0] == BEACON:
        return ((sender, v) for v in _vendor_elements(frame[36:]))
    if frame[0] == ACTION and frame[24:30] == NAN:
        return ((sender, v) for v in _services(frame[30:]))
    return iter(())


def _vendor_elements(body: bytes) -> Iterator[bytes]:
    i = 0
    while i + 2 <= len(body):
        kind, size = body[i], body[i + 1]
        value = body[i + 2 : i + 2 + size]
        if kind == VENDOR_ELEMENT and value[:4] == WIFI_ODID:
            yield value[5:]  # after a counter
        i += 2 + size


def _services(body: bytes) -> Iterator[bytes]:
    i = 0
    while i + 3 <= len(body):
        kind, size = body[i], int.from_bytes(body[i + 1 : i + 3], "little")
        value = body[i + 3 : i + 3 + size]
        if kind == SERVICE_DESCRIPTOR and value[:6] == NAN_SERVICE and len(value) > 9:
            yield _service_info(value)
        i += 3 + size


def _service_info(value: bytes) -> bytes:
    """After service, instance, requestor and control come up to three optional fields, then the information."""
    control, i = value[8], 9
    i += 2 if control & 0x20 else 0  # binding bitmap
    for bit in (0x04, 0x08):  # matching filter, response filter, each with its length
        if control & bit and i < len(value):
            i += 1 + value[i]
    if not control & 0x10 or i >= len(value):
        return b""
    return value[i + 2 : i + 1 + value[i]]  # after a counter


def _bluetooth(frame: bytes, *, coded: bool = False) -> Iterator[Found]:
    """From the access address on; on the coded PHY a coding indicator follows it."""
    if frame[:4] != ADVERTISING or len(frame) < 8:
        return iter(())
    pdu = frame[5:] if coded else frame[4:]
    if len(pdu) < 2:
        return iter(())
    kind, body = pdu[0] & 0xF, pdu[2 : 2 + pdu[1]]
    sender, advertised = _extended(body) if kind == EXTENDED else (body[:6], body[6:])
    return ((sender[::-1], v) for v in _service_data(advertised))


def _extended(body: bytes) -> tuple[bytes, bytes]:
    """Address and data of an extended advertisement: a header of given length, of which a flag says what is in it."""
    if len(body) < 2:
        return b"", b""
    size = body[0] & 0x3F
    sender = body[2:8] if size >= 7 and body[1] & 1 else bytes(6)
    return sender, body[1 + size :]


def _service_data(advertised: bytes) -> Iterator[bytes]:
    i = 0
    while i + 1 < len(advertised) and advertised[i]:
        size = advertised[i]
        value = advertised[i + 1 : i + 1 + size]
        if value[:4] == BLUETOOTH_ODID:
            yield value[5:]  # after a counter
        i += 1 + size


def _nordic(data: bytes) -> Iterator[Found]:
    """Board, length of what follows, protocol version, counter, packet type; then a header of its own length."""
    if len(data) < 18:
        return iter(())
    size = data[7]
    if not data[8] & CHECKED:
        return iter(())
    coded = (data[8] >> 4) & 7 == CODED
    return _bluetooth(data[7 + size :], coded=coded)


def _with_phdr(data: bytes) -> Iterator[Found]:
    """Ten bytes of radio before the access address; the PHY stands in the two highest bits of the flags."""
    return _bluetooth(data[10:], coded=len(data) > 10 and data[9] >> 6 == CODED)


LINKS: Final[Mapping[int, Callable[[bytes], Iterator[Found]]]] = {
    105: _wifi, 127: _radiotap, 251: _bluetooth, 256: _with_phdr, 272: _nordic,
}  # fmt: skip
