/* SPDX-License-Identifier: Apache-2.0 */
#include "web/additions.h"
#include "capture/pcapng.h"
#include "capture/trace_text.h"
#include "capture/trigger.h"
#include "setup/sections.h"
#include "web/service.h"
#include "words/value.h"

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define CONDITION_MAX 256

struct trace {
	bool writes_file;
	bool begun;
	struct db_capture_questions questions;
	struct db_capture_pcapng frames;
	char text[DB_CAPTURE_TRACE_LINE];
};

struct db_web_additions {
	const struct db_web_service *service;
	char bus[64];
	struct trace *trace; /* NULL */
	json_t *finds;       /* of a scan, until now; NULL */
	/* The value of the trigger, as text; "": there is none. */
	char condition[CONDITION_MAX];
	const char *value;
	struct db_capture_trigger trigger;
};

struct db_web_additions *db_web_additions_new(const struct db_web_request *request,
                                              const char **problem)
{
	const char *method = request->route.name;
	json_t *parameters = request->parameters;
	const json_t *trigger = json_object_get(parameters, "trigger");
	struct db_web_additions *additions = calloc(1, sizeof(*additions));
	bool needed = false;

	*problem = NULL;
	if (!additions)
		return NULL;
	additions->service = request->server->service;
	snprintf(additions->bus, sizeof(additions->bus), "%s", db_words_text(parameters, "bus"));
	if (strcmp(method, "Trace") == 0) {
		additions->trace = calloc(1, sizeof(*additions->trace));
		if (additions->trace)
			additions->trace->writes_file = json_is_true(
				json_object_get(parameters, "pcapng"));
		(void)json_object_del(parameters, "pcapng");
		needed = additions->trace;
	} else if (strcmp(method, "Scan") == 0) {
		additions->finds = json_array();
		needed = true;
	} else if (strcmp(method, "Subscribe") == 0 && trigger) {
		if (!json_is_string(trigger) || json_string_length(trigger) >= CONDITION_MAX) {
			*problem = "a trigger is a text";
		} else {
			snprintf(additions->condition, CONDITION_MAX, "%s",
			         json_string_value(trigger));
			*problem = db_capture_trigger_split(additions->condition,
			                                    &additions->trigger, &additions->value);
		}
		needed = !*problem;
		(void)json_object_del(parameters, "trigger");
	}
	if (needed)
		return additions;
	db_web_additions_free(additions);
	return NULL;
}

void db_web_additions_free(struct db_web_additions *additions)
{
	if (!additions)
		return;
	free(additions->trace);
	json_decref(additions->finds);
	free(additions);
}

static json_t *find_bus(const struct db_web_additions *additions)
{
	return db_words_look_up(json_object_get(additions->service->description, "buses"),
	                        additions->bus);
}

/* --- triggers --------------------------------------------------------------------------------- */

const char *db_web_additions_drive(const struct db_web_additions *additions)
{
	return additions && additions->condition[0] ? additions->trigger.drive : NULL;
}

bool db_web_additions_take_registers(struct db_web_additions *additions, const json_t *registers,
                                     char *problem, size_t size)
{
	const char *name = additions->trigger.name;
	const json_t *reg = db_words_look_up(registers, name);

	if (reg)
		return db_capture_trigger_set(&additions->trigger, reg, additions->value, problem,
		                              size);
	snprintf(problem, size, "%s has no register \"%s\"", additions->trigger.drive, name);
	return false;
}

/* --- traces ----------------------------------------------------------------------------------- */

static json_t *write_base64(const char *bytes, size_t size)
{
	static const char digits[] =
		"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
	char *text = malloc((size + 2) / 3 * 4 + 1);
	char *out = text;
	json_t *string;

	if (!text)
		return NULL;
	for (size_t at = 0; at < size; at += 3) {
		uint32_t group = 0;

		for (size_t i = 0; i < 3; i++)
			group = group << 8 | (at + i < size ? (uint8_t)bytes[at + i] : 0U);
		for (size_t i = 0; i < 4; i++)
			*out++ = at + i > size ? '=' : digits[group >> (18 - 6 * i) & 63];
	}
	string = json_stringn(text, (size_t)(out - text));
	free(text);
	return string;
}

/* The next bytes of the file, as a member of `object`: of a record, NULL: its head. */
static void add_file(struct db_web_additions *additions, json_t *object, const json_t *record)
{
	struct trace *trace = additions->trace;
	char *bytes = NULL;
	size_t size = 0;
	FILE *file = open_memstream(&bytes, &size);
	bool written;

	if (!file)
		return;
	written = record ? db_capture_pcapng_take(&trace->frames, record, trace->text, file) :
	                   db_capture_pcapng_begin(file, find_bus(additions));
	if (fclose(file) == 0 && written && size > 0)
		(void)json_object_set_new(object, "pcapng", write_base64(bytes, size));
	free(bytes);
}

static void complete_trace(struct db_web_additions *additions, json_t *answer)
{
	struct trace *trace = additions->trace;
	size_t i;
	json_t *record;

	if (trace->writes_file && !trace->begun)
		add_file(additions, answer, NULL);
	trace->begun = true;
	trace->frames.missed += json_integer_value(json_object_get(answer, "missed"));
	json_array_foreach(json_object_get(answer, "records"), i, record)
	{
		db_capture_trace_take(&trace->questions, record, trace->text, sizeof(trace->text));
		if (trace->writes_file)
			add_file(additions, record, record);
		(void)json_object_set_new(record, "words", json_string(trace->text));
		db_capture_trace_write_bytes(record, trace->text, sizeof(trace->text));
		if (trace->text[0] != '\0')
			(void)json_object_set_new(record, "bytes", json_string(trace->text));
		(void)json_object_del(record, "data");
	}
}

/* --- all -------------------------------------------------------------------------------------- */

void db_web_additions_complete(struct db_web_additions *additions, json_t *answer)
{
	const json_t *description;
	const json_t *bus;
	char *text;
	size_t i;
	json_t *sample;

	if (!additions)
		return;
	if (additions->trace) {
		complete_trace(additions, answer);
		return;
	}
	if (additions->finds) {
		description = additions->service->description;
		bus = find_bus(additions);
		(void)json_array_extend(additions->finds, json_object_get(answer, "finds"));
		text = bus ? db_setup_write_sections(bus, additions->finds,
		                                     json_object_get(description, "drives")) :
		             NULL;
		if (text)
			(void)json_object_set_new(answer, "configuration", json_string(text));
		free(text);
		return;
	}
	/* Samples that fulfil the trigger's condition are marked. */
	json_array_foreach(json_object_get(answer, "samples"), i, sample)
	{
		if (strcmp(db_words_text(sample, "drive"), additions->trigger.drive) == 0 &&
		    db_capture_trigger_take(&additions->trigger, json_object_get(sample, "values")))
			(void)json_object_set_new(sample, "triggers", json_true());
	}
}
