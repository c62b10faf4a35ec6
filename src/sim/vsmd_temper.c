/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/vsmd_temper.h"

#include "codec/vsmd_can.h"
#include "sim/vsmd_mechanics.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

bool sim_vsmd_has_registers(const struct sim_vsmd_temper *temper, unsigned first, unsigned count)
{
	for (size_t i = 0; i < temper->lacks_count; i++) {
		if (first <= temper->lacks[i].last && first + count > temper->lacks[i].first)
			return false;
	}
	return true;
}

bool sim_registers_parse(const char *text, struct sim_registers *registers)
{
	char *end;
	unsigned long first = strtoul(text, &end, 16);
	unsigned long last = first;

	if (end == text)
		return false;
	if (*end == '-') {
		text = end + 1;
		last = strtoul(text, &end, 16);
		if (end == text)
			return false;
	}
	if (*end != '\0' || first > last || last > VSMD_CAN_REG_MAX)
		return false;
	registers->first = (uint8_t)first;
	registers->last = (uint8_t)last;
	return true;
}

/* --- texts ------------------------------------------------------------------------------------ */

struct writer {
	char *text;
	size_t size;
	size_t length;
};

static void put(struct writer *writer, const char *bytes, size_t length)
{
	if (writer->length + length <= writer->size)
		memcpy(writer->text + writer->length, bytes, length);
	writer->length += length;
}

/* "name=number name=number", or a text without any. */
static void put_pairs(struct writer *writer, const struct sim_vsmd_temper *temper, const char *text,
                      size_t length)
{
	const char *end = text + length;
	char number[64];
	int written;

	while (text < end) {
		const char *equals = memchr(text, '=', (size_t)(end - text));
		const char *blank;
		size_t digits;

		if (!equals) {
			put(writer, text, (size_t)(end - text));
			return;
		}
		/* "name=" in this drive's letter case. */
		for (size_t i = 0; i < (size_t)(equals + 1 - text); i++) {
			char letter = text[i];

			if (temper->capitals && letter >= 'a' && letter <= 'z')
				letter = (char)(letter - 'a' + 'A');
			put(writer, &letter, 1);
		}
		text = equals + 1;
		blank = memchr(text, ' ', (size_t)(end - text));
		digits = (size_t)((blank ? blank : end) - text);
		switch (temper->numbers) {
		case SIM_NUMBERS_EXPONENT:
			written = snprintf(number, sizeof(number), "%.*s", (int)digits, text);
			if (written > 0 && (size_t)written < sizeof(number))
				written = snprintf(number, sizeof(number), "%.9e",
				                   strtod(number, NULL));
			put(writer, number, written > 0 ? (size_t)written : 0);
			break;
		case SIM_NUMBERS_QUOTED:
			put(writer, "\"", 1);
			put(writer, text, digits);
			put(writer, "\"", 1);
			break;
		case SIM_NUMBERS_PLAIN:
		default:
			put(writer, text, digits);
			break;
		}
		text = end;
		if (blank) {
			put(writer, temper->commas ? "," : " ", 1);
			text = blank + 1;
		}
	}
}

int sim_vsmd_dress_text(const struct sim_vsmd_temper *temper, const char *text, size_t length,
                        char *out, size_t size)
{
	struct writer writer = { .text = out, .size = size };

	if (temper->text == SIM_TEXT_QUOTED)
		put(&writer, "\"", 1);
	put_pairs(&writer, temper, text, length);
	if (memchr(text, '=', length)) {
		/* Parameters that no document names. */
		unsigned number = 0;

		while (writer.length < temper->text_length) {
			char pair[32];
			int count = snprintf(pair, sizeof(pair), "%cx%u=%u",
			                     temper->commas ? ',' : ' ', number, number * 7);

			number++;
			put(&writer, pair, count > 0 ? (size_t)count : 0);
		}
	}
	if (temper->text == SIM_TEXT_QUOTED)
		put(&writer, "\"", 1);
	if (temper->text == SIM_TEXT_NUL)
		put(&writer, "", 1);
	if (temper->text == SIM_TEXT_CRLF)
		put(&writer, "\r\n", 2);
	return writer.length <= size ? (int)writer.length : -1;
}

/* --- statuses --------------------------------------------------------------------------------- */

void sim_vsmd_report_status(struct sim_vsmd *drive, bool read, db_time now,
                            struct vsmd_status *status)
{
	static const uint32_t levels[SIM_VSMD_SENSORS] = { VSMD_ST_S1, VSMD_ST_S2, VSMD_ST_S3,
		                                           VSMD_ST_S4, VSMD_ST_S5, VSMD_ST_S6 };
	const struct sim_vsmd_temper *temper = &drive->config.temper;

	if (read && sim_vsmd_refusal(drive) == SIM_REFUSAL_CLEARED)
		drive->flags &= ~(uint32_t)VSMD_ST_CMD_WRG;
	sim_vsmd_status(drive, now, status);
	if (status->status & VSMD_ST_STP) {
		/* A held motor deviates from its position in every second report. */
		drive->trembled = !drive->trembled;
		status->position += temper->rests_off + (drive->trembled ? temper->trembles : 0);
	}
	if (temper->speed != SIM_SPEED_SIGNED)
		status->velocity = temper->speed == SIM_SPEED_NONE ? 0.0f : fabsf(status->velocity);
	if (temper->mirrored) {
		status->position = -status->position;
		status->velocity = -status->velocity;
	}
	status->status &= ~(uint32_t)(VSMD_ST_PWR | VSMD_ST_STP);
	status->status |= drive->power_bit.shown ? VSMD_ST_PWR : 0;
	status->status |= drive->standing_bit.shown ? VSMD_ST_STP : 0;
	for (unsigned i = 0; i < SIM_VSMD_SENSORS && temper->hides_outputs; i++) {
		if (drive->params[(unsigned)VSMD_S1 + i].u == 1)
			status->status &= ~levels[i];
	}
	if (sim_vsmd_refusal(drive) == SIM_REFUSAL_ONCE)
		drive->flags &= ~(uint32_t)VSMD_ST_CMD_WRG;
}
