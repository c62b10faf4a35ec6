/* SPDX-License-Identifier: Apache-2.0 */
#include "config/keys.h"

#include <string.h>

#define NUMBER(s, n, p, low, high, u, d)                                                 \
	{                                                                                \
		.section = s, .name = n, .kind = DB_KEY_NUMBER, .preset = p, .min = low, \
		.max = high, .unit = u, .words = "", .only = "", .description = d        \
	}
#define WORD(s, n, p, w, d)                                                                        \
	{                                                                                          \
		.section = s, .name = n, .kind = DB_KEY_WORD, .preset = p, .unit = "", .words = w, \
		.only = "", .description = d                                                       \
	}
#define OTHER(k, s, n, p, low, high, d)                                                   \
	{                                                                                 \
		.section = s, .name = n, .kind = k, .preset = p, .min = low, .max = high, \
		.unit = "", .words = "", .only = "", .description = d                     \
	}
#define FOREIGN(s, n, o, d)                                                                       \
	{                                                                                         \
		.section = s, .name = n, .kind = DB_KEY_TEXT, .preset = "", .min = 1, .max = 255, \
		.unit = "", .words = "", .only = o, .description = d                              \
	}

/* clang-format off */
static const struct db_config_key KEYS[] = {
	OTHER(DB_KEY_LISTEN, "modbus", "listen", "127.0.0.1:502", 0, 0,
	      "Address and port to listen on, [ADDRESS]:PORT for IPv6; port 0 takes any free one"),
	OTHER(DB_KEY_NETWORKS, "modbus", "allow-read", "0.0.0.0/0 ::/0", 0, 0,
	      "Networks whose clients may connect and read; an empty list means nobody"),
	OTHER(DB_KEY_NETWORKS, "modbus", "allow-write", "127.0.0.0/8 ::1/128", 0, 0,
	      "Networks whose clients may read and write; an empty list means nobody"),
	WORD("modbus", "word-order", "high-first", "high-first low-first",
	     "Which 16-bit register of a 32-bit value comes first"),
	NUMBER("modbus", "confirm-ms", "40", 1, 10000, "ms",
	       "Longest wait for a drive's confirmation before a write is answered with exception 05"),
	WORD("modbus", "write-confirm", "confirmed", "confirmed accepted",
	     "Answer a write when the drive has confirmed it, or as soon as it is queued"),
	WORD("modbus", "stale", "exception", "exception value",
	     "How process data of a drive that does not answer are read: exception 0B, or the last values"),
	NUMBER("modbus", "gateway-unit", "0", 0, 254, "",
	       "Unit id of the gateway's own registers beside 0 and 255; 0 means no further one"),
	NUMBER("modbus", "max-clients", "64", 1, 1024, "",
	       "Connections served at the same time"),
	NUMBER("modbus", "max-pipelined", "16", 1, 64, "",
	       "Requests of one connection that may be in work at the same time"),
	NUMBER("modbus", "frame-timeout-ms", "1000", 100, 60000, "ms",
	       "Longest time for an unfinished request before its connection is closed"),
	NUMBER("modbus", "idle-timeout-s", "0", 0, 86400, "s",
	       "Longest silence before a connection is closed; 0 means never"),

	OTHER(DB_KEY_PROTOCOL, "bus", "protocol", NULL, 0, 0,
	      "Family of the drives on this bus"),
	OTHER(DB_KEY_TEXT, "bus", "device", NULL, 1, 255,
	      "Path of the serial port"),
	NUMBER("bus", "baud", "", 300, 4000000, "baud",
	       "Speed of the line; the family's usual one when not given"),
	WORD("bus", "parity", "none", "none even odd",
	     "Parity bit"),
	NUMBER("bus", "stop-bits", "1", 1, 2, "",
	       "Number of stop bits"),
	WORD("bus", "line", "rs485", "rs485 rs232",
	     "RS485: several drives with addresses; RS232: one drive without an address"),
	NUMBER("bus", "cycle-ms", "20", 1, 10000, "ms",
	       "Period in which every drive's status is read"),
	NUMBER("bus", "drive-latency-ms", "30", 1, 1000, "ms",
	       "Longest time a drive may take before it begins to answer"),
	NUMBER("bus", "retries", "2", 0, 10, "",
	       "Repeats of a lost harmless exchange before the drive counts as offline"),
	NUMBER("bus", "queue", "32", 1, 256, "",
	       "Commands that may wait for this bus"),
	NUMBER("bus", "save-interval-s", "10", 0, 3600, "s",
	       "Shortest time between two save_parameters of one drive, because they wear its memory"),
	NUMBER("bus", "priority", "0", 0, 99, "",
	       "Real-time priority (SCHED_FIFO) of the bus's thread; 0 means none"),
	FOREIGN("bus", "interface", "CAN families", "CAN network interface"),
	FOREIGN("bus", "transport", "CAN families", "How the CAN bus is reached"),
	FOREIGN("bus", "bitrate", "CAN families", "Bit rate of the CAN bus"),

	OTHER(DB_KEY_BUS, "drive", "bus", NULL, 0, 0,
	      "Name of the bus the drive is connected to"),
	NUMBER("drive", "address", "", 0, 65535, "",
	       "Address on the bus, in the family's range; must be given on RS485, not on RS232"),
	NUMBER("drive", "unit", NULL, 1, 247, "",
	       "Modbus unit id under which the drive answers"),
	{ .section = "drive", .name = "counts-per-unit", .kind = DB_KEY_REAL, .preset = "1.0",
	  .min = 1e-9, .max = 1e9, .unit = "", .words = "", .only = "",
	  .description = "Drive units in one of the user's units" },
	OTHER(DB_KEY_TEXT, "drive", "unit-name", "counts", 1, 31,
	      "Name of the user's unit"),
	WORD("drive", "on-client-loss", "stop", "none stop quick-stop disable",
	     "What the drive does when its PLC falls silent"),
	WORD("drive", "on-exit", "", "none stop quick-stop disable",
	     "What the drive does when the service ends; as on-client-loss when not given"),
	NUMBER("drive", "watchdog-ms", "3000", 0, 60000, "ms",
	       "Longest silence of the PLC after a motion command; 0 turns the watchdog off"),
	FOREIGN("drive", "axis", "multi-axis families", "Axis of a multi-axis controller"),
};
/* clang-format on */

#define KEY_COUNT (sizeof(KEYS) / sizeof(KEYS[0]))
#define NAME_MAX_COMPARED 63

const struct db_config_key *db_config_keys(size_t *count)
{
	*count = KEY_COUNT;
	return KEYS;
}

const struct db_config_key *db_config_key_find(const char *section, const char *name)
{
	for (size_t i = 0; i < KEY_COUNT; i++) {
		if (strcmp(KEYS[i].section, section) == 0 && strcmp(KEYS[i].name, name) == 0)
			return &KEYS[i];
	}
	return NULL;
}

static unsigned least(unsigned a, unsigned b, unsigned c)
{
	unsigned ab = a < b ? a : b;

	return ab < c ? ab : c;
}

/* Levenshtein's distance: letters to insert, delete or replace. */
static unsigned distance(const char *a, const char *b)
{
	unsigned row[NAME_MAX_COMPARED + 1];
	size_t length = strnlen(b, NAME_MAX_COMPARED);

	for (unsigned j = 0; j <= length; j++)
		row[j] = j;
	for (size_t i = 0; i < NAME_MAX_COMPARED && a[i]; i++) {
		unsigned diagonal = row[0];

		row[0]++;
		for (size_t j = 0; j < length; j++) {
			unsigned above = row[j + 1];

			row[j + 1] = least(above + 1, row[j] + 1, diagonal + (a[i] != b[j]));
			diagonal = above;
		}
	}
	return row[length];
}

const struct db_config_key *db_config_key_nearest(const char *section, const char *name)
{
	const struct db_config_key *nearest = NULL;
	unsigned best = 0;

	for (size_t i = 0; i < KEY_COUNT; i++) {
		unsigned far = distance(name, KEYS[i].name);

		if (strcmp(KEYS[i].section, section) != 0)
			continue;
		if (!nearest || far < best) {
			nearest = &KEYS[i];
			best = far;
		}
	}
	return nearest;
}

const char *db_config_key_elsewhere(const char *section, const char *name)
{
	for (size_t i = 0; i < KEY_COUNT; i++) {
		if (strcmp(KEYS[i].section, section) != 0 && strcmp(KEYS[i].name, name) == 0)
			return KEYS[i].section;
	}
	return NULL;
}
