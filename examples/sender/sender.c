/* What a bridge sends, in C99: writes the four packets of docs/racklink.md to standard output. */
#include <stdint.h>
#include <stdio.h>
#include <string.h>

static uint8_t packet[4096], *end = packet; /* the packet being built, and where its next byte goes */
static uint32_t sequence;

static void put(uint64_t value, int bytes) /* little-endian on every machine */
{
    for (; bytes > 0; bytes--, value >>= 8) *end++ = (uint8_t)value;
}

static uint32_t crc32(const uint8_t *from, const uint8_t *to)
{
    uint32_t crc = 0xFFFFFFFF;
    while (from < to) {
        crc ^= *from++;
        for (int bit = 0; bit < 8; bit++) crc = crc & 1 ? crc >> 1 ^ 0xEDB88320 : crc >> 1;
    }
    return ~crc;
}

static void send_cobs(const uint8_t *from, const uint8_t *to)
{
    for (;;) { /* a group: one more than its length, then its bytes; a group shorter than 254 stands for a zero too */
        int length = 0;
        while (length < 254 && from + length < to && from[length]) length++;
        putchar(length + 1);
        fwrite(from, 1, (size_t)length, stdout);
        from += length;
        if (from == to) break;
        if (length < 254) from++;
    }
    putchar(0);
}

static void begin(int type, int channel, int flags, uint64_t time_ns)
{
    end = packet;
    put(1, 1), put((uint64_t)type, 1), put((uint64_t)channel, 1), put((uint64_t)flags, 1);
    put(sequence++, 4), put(time_ns, 8);
}

static void finish(void)
{
    put(crc32(packet, end), 4);
    send_cobs(packet, end);
}

int main(void)
{
    static const uint8_t header[] = {0xB4, 0x43, 0x04, 0x7A, 0x0E, 0x80, 0x76, 0x7C}, bins[] = {0x88, 0xC6, 0xFA};

    begin(0x01, 0, 0, 0); /* hello: bridge, firmware, then channel, kind, orientation and equipment of each channel */
    put(0x1234, 4), put(0x0102, 2);
    put(0, 1), put(0x70, 1), put(0, 1), put(0, 1);
    put(1, 1), put(0x2A, 1), put(0, 1), put(4, 1);
    finish();

    begin(0x10, 1, 0x01, 1500000000); /* two ARINC 429 words, 360 us apart, after two that were lost in the bridge */
    put(0, 4), put(0x600C808B, 4);
    put(360000, 4), put(0xE00190A1, 4);
    finish();

    begin(0x20, 0, 0, 1502000000); /* an ARINC 708 word of 1600 bits */
    put(1600, 2);
    memcpy(end, header, sizeof header), end += sizeof header;
    for (int k = 0; k < 192; k++) put(bins[k % 3], 1);
    finish();

    begin(0x02, 0, 0, 2000000000); /* heartbeat: channel, words sent, words lost */
    put(0, 1), put(1, 4), put(0, 4);
    put(1, 1), put(2, 4), put(2, 4);
    finish();
    return 0;
}
