/* SPDX-License-Identifier: Apache-2.0 */
#include "mqtt/packet.h"

enum type {
	CONNACK = 2,
	PUBLISH = 3,
	PUBACK = 4,
	PUBREC = 5,
	PUBREL = 6,
	PUBCOMP = 7,
	SUBACK = 9,
	UNSUBACK = 11,
	PINGRESP = 13,
	DISCONNECT = 14,
};

/* The remaining bytes of a packet. */
struct rest {
	const uint8_t *at;
	size_t left;
};

static bool skip(struct rest *rest, size_t count)
{
	if (count > rest->left)
		return false;
	rest->at += count;
	rest->left -= count;
	return true;
}

/* A text or bytes, after their length. */
static bool skip_text(struct rest *rest)
{
	size_t length;

	if (rest->left < 2)
		return false;
	length = (size_t)rest->at[0] << 8 | rest->at[1];
	return skip(rest, 2 + length);
}

/* A number of one to four bytes. *more: it is incomplete. */
static bool take_number(struct rest *rest, size_t *number, bool *more)
{
	*number = 0;
	*more = false;
	for (unsigned i = 0; i < 4; i++) {
		uint8_t byte;

		if (rest->left == 0) {
			*more = true;
			return false;
		}
		byte = *rest->at;
		(void)skip(rest, 1);
		*number |= (size_t)(byte & 0x7F) << 7 * i;
		if (!(byte & 0x80))
			return true;
	}
	return false;
}

/* --- properties ------------------------------------------------------------------------------- */

static bool skip_value(struct rest *rest, uint8_t property)
{
	size_t number;
	bool more;

	switch (property) {
	case 0x01: /* payload format */
	case 0x17: /* request problem information */
	case 0x19: /* request response information */
	case 0x24: /* maximum quality of service */
	case 0x25: /* retain available */
	case 0x28: /* wildcards available */
	case 0x29: /* subscription identifiers available */
	case 0x2A: /* shared subscriptions available */
		return skip(rest, 1);
	case 0x13: /* server keep alive */
	case 0x21: /* receive maximum */
	case 0x22: /* topic alias maximum */
	case 0x23: /* topic alias */
		return skip(rest, 2);
	case 0x02: /* message expiry */
	case 0x11: /* session expiry */
	case 0x18: /* will delay */
	case 0x27: /* maximum packet size */
		return skip(rest, 4);
	case 0x0B: /* subscription identifier */
		return take_number(rest, &number, &more);
	case 0x03: /* content type */
	case 0x08: /* response topic */
	case 0x09: /* correlation data */
	case 0x12: /* assigned client identifier */
	case 0x15: /* authentication method */
	case 0x16: /* authentication data */
	case 0x1A: /* response information */
	case 0x1C: /* server reference */
	case 0x1F: /* reason */
		return skip_text(rest);
	case 0x26: /* user property: its name and its value */
		if (!skip_text(rest))
			return false;
		return skip_text(rest);
	default:
		return false;
	}
}

static bool skip_properties(struct rest *rest)
{
	struct rest properties;
	size_t length;
	bool more;

	if (!take_number(rest, &length, &more) || length > rest->left)
		return false;
	properties = (struct rest){ .at = rest->at, .left = length };
	while (properties.left > 0) {
		uint8_t property = *properties.at;

		(void)skip(&properties, 1);
		if (!skip_value(&properties, property))
			return false;
	}
	return skip(rest, length);
}

/* --- packets ---------------------------------------------------------------------------------- */

/* `fixed` bytes that are always there; then a reason and properties, if the packet is longer. */
static bool check_reason(struct rest *rest, size_t fixed, bool version_5)
{
	if (!skip(rest, fixed))
		return false;
	if (!version_5 || rest->left == 0)
		return true;
	return skip(rest, 1) && (rest->left == 0 || skip_properties(rest));
}

static bool check_rest(struct rest *rest, enum type type, unsigned flags, bool version_5)
{
	unsigned qos = flags >> 1 & 3;

	switch (type) {
	case CONNACK:
		/* The packet of a broker before MQTT 5 ends here, whatever version the client
		 * requested. */
		return skip(rest, 2) && (!version_5 || rest->left == 0 || skip_properties(rest));
	case PUBLISH:
		return qos < 3 && skip_text(rest) && (qos == 0 || skip(rest, 2)) &&
		       (!version_5 || skip_properties(rest));
	case PUBACK:
	case PUBREC:
	case PUBREL:
	case PUBCOMP:
		return check_reason(rest, 2, version_5);
	case SUBACK:
	case UNSUBACK:
		return skip(rest, 2) && (!version_5 || skip_properties(rest));
	case PINGRESP:
		return rest->left == 0;
	case DISCONNECT:
		return version_5 && check_reason(rest, 0, version_5);
	default:
		/* Packets of clients, or an authentication that was not offered. */
		return false;
	}
}

enum db_mqtt_verdict db_mqtt_packet_check(const uint8_t *bytes, size_t count, bool version_5,
                                          size_t *length)
{
	struct rest rest = { .at = bytes, .left = count };
	size_t body;
	bool more;

	*length = 0;
	if (!skip(&rest, 1))
		return DB_MQTT_PACKET_PART;
	if (!take_number(&rest, &body, &more))
		return more ? DB_MQTT_PACKET_PART : DB_MQTT_PACKET_WRONG;
	if ((size_t)(rest.at - bytes) + body > DB_MQTT_PACKET_MAX)
		return DB_MQTT_PACKET_WRONG;
	if (body > rest.left)
		return DB_MQTT_PACKET_PART;
	*length = (size_t)(rest.at - bytes) + body;
	rest.left = body;
	return check_rest(&rest, (enum type)(bytes[0] >> 4), bytes[0] & 0xF, version_5) ?
	               DB_MQTT_PACKET_WHOLE :
	               DB_MQTT_PACKET_WRONG;
}
