/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/faults.h"

#include <stdlib.h>
#include <string.h>

enum form { FORM_COUNT, FORM_NUMBER, FORM_SWITCH };

static const struct {
	const char *name;
	enum form form;
} kinds[SIM_FAULT_COUNT] = {
	[SIM_FAULT_DROP] = { "drop", FORM_COUNT },
	[SIM_FAULT_LOSE_REQUEST] = { "lose-request", FORM_COUNT },
	[SIM_FAULT_DELAY] = { "delay", FORM_NUMBER },
	[SIM_FAULT_CORRUPT] = { "corrupt", FORM_COUNT },
	[SIM_FAULT_CORRUPT_AT] = { "corrupt-at", FORM_NUMBER },
	[SIM_FAULT_TRUNCATE] = { "truncate", FORM_COUNT },
	[SIM_FAULT_GARBAGE] = { "garbage", FORM_COUNT },
	[SIM_FAULT_SPLIT] = { "split", FORM_COUNT },
	[SIM_FAULT_DOUBLE] = { "double", FORM_COUNT },
	[SIM_FAULT_WRONG_ID] = { "wrong-id", FORM_COUNT },
	[SIM_FAULT_SILENCE] = { "silence", FORM_SWITCH },
	[SIM_FAULT_ECHO] = { "echo", FORM_SWITCH },
	[SIM_FAULT_BUS_OFF] = { "bus-off", FORM_SWITCH },
	[SIM_FAULT_RUNAWAY] = { "runaway", FORM_SWITCH },
	[SIM_FAULT_LOSE_END] = { "lose-end", FORM_COUNT },
};

static bool read_number(const char *text, int32_t *number)
{
	char *end;
	long value = strtol(text, &end, 10);

	if (end == text || *end != '\0' || value < 1 || value > 1000000)
		return false;
	*number = (int32_t)value;
	return true;
}

const char *sim_faults_set(struct sim_faults *faults, const char *text)
{
	char copy[64];
	char *words[4] = { NULL };
	char *save = NULL;
	unsigned count = 0;
	unsigned frequency = 1; /* the word that says how often */
	int32_t left = -1;
	int32_t number = 0;
	int kind = 0;

	if (strlen(text) >= sizeof(copy))
		return "too long";
	strcpy(copy, text);
	for (char *word = strtok_r(copy, " \t", &save); word; word = strtok_r(NULL, " \t", &save)) {
		if (count == 4)
			return "too many words";
		words[count++] = word;
	}
	if (count == 1 && strcmp(words[0], "none") == 0) {
		*faults = (struct sim_faults){ .delay_ms = 0 };
		return NULL;
	}
	while (kind < SIM_FAULT_COUNT && (count == 0 || strcmp(words[0], kinds[kind].name) != 0))
		kind++;
	if (kind == SIM_FAULT_COUNT)
		return "no such fault; there are " SIM_FAULT_NAMES;
	switch (kinds[kind].form) {
	case FORM_SWITCH:
		if (count != 2 || (strcmp(words[1], "on") != 0 && strcmp(words[1], "off") != 0))
			return "this fault needs \"on\" or \"off\"";
		left = strcmp(words[1], "on") == 0 ? -1 : 0;
		break;
	case FORM_NUMBER:
		if (count < 2 || !read_number(words[1], &number))
			return "delay needs milliseconds and corrupt-at a place, 1 to 1000000; "
			       "both may have a count";
		frequency++;
		/* fall through */
	case FORM_COUNT:
	default:
		if (count > frequency + 1 ||
		    (count == frequency + 1 && !read_number(words[frequency], &left)))
			return "how often must be 1 to 1000000, or left out for always";
		break;
	}
	faults->left[kind] = left;
	if (kind == SIM_FAULT_DELAY)
		faults->delay_ms = (uint32_t)number;
	if (kind == SIM_FAULT_CORRUPT_AT)
		faults->corrupt_at = (uint32_t)number;
	return NULL;
}

bool sim_faults_take(struct sim_faults *faults, enum sim_fault fault)
{
	if (faults->left[fault] == 0)
		return false;
	if (faults->left[fault] > 0)
		faults->left[fault]--;
	return true;
}
