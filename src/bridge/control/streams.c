/* SPDX-License-Identifier: Apache-2.0 */
#include "control/control_private.h"

#include "drivebridge/clock.h"

#include "control/message.h"
#include "control/values.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

/* Interval at which the log is checked for new events. */
#define EVENTS_INTERVAL (100 * DB_NS_PER_MS)
#define INTERVAL_MAX_MS 3600000
#define SHORTEST DB_NS_PER_MS

/* --- Subscribe -------------------------------------------------------------------------------- */

#define NAMES_MAX 128
#define FAMILIES_MAX 8
#define DRIVES_MAX 247

/* The chosen registers of the drives of one family. */
struct choice {
	const struct db_name_list *list; /* the family's registers */
	const struct db_entry *entries[NAMES_MAX];
	size_t count;
};

/* The value of a register that was last sent to the client. */
struct told {
	bool told;
	enum db_named_kind kind;
	uint64_t bits; /* the value; unused for a text */
};

/* Of a drive, while it goes on. */
struct followed {
	uint16_t number;
	uint16_t choice;
	bool begun;
	db_time taken;    /* time of the data that were sent last, or left out */
	uint32_t samples; /* number of samples at the last sending */
};

struct stream {
	uint32_t generation; /* generation of the registers when the choices were made */
	db_time interval;    /* 0: with every cycle */
	db_time period;      /* time between two checks */
	int64_t skipped;
	struct choice choices[FAMILIES_MAX];
	size_t choice_count;
	size_t drive_count;
	struct followed drives[DRIVES_MAX];
	/* The drives that were asked for, by name, one after the other in `told`'s memory; 0: all
	 * of them. */
	size_t wanted_count;
	char *wanted;
	size_t name_count;
	char names[NAMES_MAX][DB_ROW_NAME_MAX];
	size_t told_places; /* for each drive */
	size_t told_count;  /* 0: not only changed values are sent */
	struct told told[];
};

/* Finds the names for the drives with this list; returns its index, or FAMILIES_MAX when there are
 * too many. */
static size_t choose(struct stream *stream, const struct db_name_list *list)
{
	struct choice *choice;
	size_t place = 0;

	while (place < stream->choice_count && stream->choices[place].list != list)
		place++;
	if (place < stream->choice_count || place == FAMILIES_MAX)
		return place;
	choice = &stream->choices[stream->choice_count++];
	*choice = (struct choice){ .list = list };
	for (size_t i = 0; stream->name_count == 0 && i < list->count && choice->count < NAMES_MAX;
	     i++) {
		if (db_look_is_process(&list->entries[i]))
			choice->entries[choice->count++] = &list->entries[i];
	}
	for (size_t i = 0; i < stream->name_count; i++) {
		const struct db_entry *entry = db_name_list_find(list, stream->names[i]);

		if (entry)
			choice->entries[choice->count++] = entry;
	}
	return place;
}

static void follow(struct stream *stream, struct db_registers *registers,
                   const struct followed *before, size_t count, uint16_t number)
{
	const struct db_name_list *list = db_named_registers(registers, number);
	size_t place = list && stream->drive_count < DRIVES_MAX ? choose(stream, list) :
	                                                          FAMILIES_MAX;
	struct followed *drive;
	db_time cycle;

	if (place == FAMILIES_MAX)
		return;
	cycle = db_named_cycle(registers, number);
	/* Twice as often as new data arrive, so that none is missed. */
	if (stream->interval == 0 && cycle / 2 < stream->period)
		stream->period = cycle / 2 > SHORTEST ? cycle / 2 : SHORTEST;
	/* What was sent of this drive, unless it is another one now: a reload gives a changed drive
	 * a new number. */
	drive = &stream->drives[stream->drive_count++];
	*drive = (struct followed){ .number = number };
	for (size_t i = 0; i < count; i++) {
		if (before[i].number == number)
			*drive = before[i];
	}
	drive->choice = (uint16_t)place;
}

/*
 * The drives that are there now, and their registers: of those that were asked for by name the ones
 * with these names, whatever a reload has changed of them.
 */
static void find_again(struct stream *stream, struct db_registers *registers)
{
	struct followed before[DRIVES_MAX];
	size_t count = stream->drive_count;
	const char *name = stream->wanted;
	struct db_named_drive drive;

	memcpy(before, stream->drives, count * sizeof(before[0]));
	stream->generation = db_named_generation(registers);
	stream->choice_count = 0;
	stream->drive_count = 0;
	memset(stream->told, 0, stream->told_count * sizeof(stream->told[0]));
	stream->period = stream->interval != 0 ? stream->interval : DB_NS_PER_S;
	for (size_t i = 0; stream->wanted_count == 0 && i < db_named_drive_count(registers); i++) {
		if (db_named_drive_at(registers, i, &drive))
			follow(stream, registers, before, count, drive.number);
	}
	for (size_t i = 0; i < stream->wanted_count; i++, name += strlen(name) + 1) {
		if (db_named_drive_find(registers, name, &drive))
			follow(stream, registers, before, count, drive.number);
	}
}

/* False when the call was answered already. */
static bool take_drives(const struct db_call *call, struct stream *stream, const json_t *names)
{
	struct db_registers *registers = call->session->control->setup.registers;
	char *at = stream->wanted;
	struct db_named_drive drive;

	for (; stream->wanted_count < json_array_size(names); stream->wanted_count++) {
		const char *name = json_string_value(json_array_get(names, stream->wanted_count));

		if (!db_named_drive_find(registers, name, &drive)) {
			db_session_fail_drive(call->session, name);
			return false;
		}
		at = stpcpy(at, name) + 1;
	}
	return true;
}

/* The bytes of all these texts, each with its end. */
static size_t measure_texts(const json_t *texts)
{
	size_t size = 0;
	size_t i;
	const json_t *text;

	json_array_foreach(texts, i, text) size += json_string_length(text) + 1;
	return size;
}

/* A name that no drive has; null. */
static const char *find_unknown(const struct stream *stream)
{
	for (size_t n = 0; n < stream->name_count; n++) {
		bool known = false;

		for (size_t i = 0; i < stream->choice_count; i++)
			known = known ||
			        db_name_list_find(stream->choices[i].list, stream->names[n]);
		if (!known)
			return stream->names[n];
	}
	return NULL;
}

void db_streams_subscribe(const struct db_call *call)
{
	struct db_session *session = call->session;
	const char *unknown;
	struct stream *stream;
	bool changes = false;
	size_t drive_count;
	size_t name_count;
	size_t told_count;
	int64_t interval_ms;
	json_t *drives;
	json_t *names;

	if (!db_call_texts(call, "drives", &drives) || !db_call_texts(call, "names", &names) ||
	    !db_call_number(call, "interval_ms", 0, INTERVAL_MAX_MS, &interval_ms) ||
	    !db_call_optional_flag(call, "changes", &changes))
		return;
	if (json_array_size(names) > NAMES_MAX || json_array_size(drives) > DRIVES_MAX) {
		db_session_fail_result(session, DB_RESULT_BUSY, "");
		return;
	}
	drive_count = db_named_drive_count(session->control->setup.registers);
	if (json_array_size(drives) > 0)
		drive_count = json_array_size(drives);
	name_count = json_array_size(names) > 0 ? json_array_size(names) : NAMES_MAX;
	told_count = changes ? drive_count * name_count : 0;
	stream = calloc(1,
	                sizeof(*stream) + told_count * sizeof(struct told) + measure_texts(drives));
	if (!stream) {
		db_session_fail_result(session, DB_RESULT_BUSY, "");
		return;
	}
	session->job = stream;
	stream->interval = interval_ms * DB_NS_PER_MS;
	stream->told_places = name_count;
	stream->told_count = told_count;
	stream->wanted = (char *)&stream->told[told_count];
	if (!take_drives(call, stream, drives))
		return;
	for (; stream->name_count < json_array_size(names); stream->name_count++) {
		const char *name = json_string_value(json_array_get(names, stream->name_count));

		if (strlen(name) >= DB_ROW_NAME_MAX) {
			db_session_fail_register(session, "", name);
			return;
		}
		strcpy(stream->names[stream->name_count], name);
	}
	find_again(stream, session->control->setup.registers);
	unknown = find_unknown(stream);
	if (unknown && stream->drive_count > 0) {
		db_session_fail_register(session, "", unknown);
		return;
	}
	session->wait = DB_WAITS_FOR_VALUES;
	session->due = db_control_now(session->control);
}

/* The values of one drive while they are read. */
struct collection {
	json_t *values;
	const struct told *before; /* null: all of them are sent */
	struct told now[NAMES_MAX];
	size_t count;
};

static void collect(void *context, const char *name, const struct db_entry *entry,
                    const struct db_named_value *value)
{
	struct collection *collection = context;
	size_t place = collection->count++;
	struct told *now = &collection->now[place];

	*now = (struct told){ .told = true, .kind = value->kind };
	if (value->kind == DB_NAMED_REAL)
		memcpy(&now->bits, &value->real, sizeof(value->real));
	else if (value->kind != DB_NAMED_TEXT)
		now->bits = (uint64_t)value->whole;
	/* A text is sent each time: few change, and few are requested. */
	if (collection->before && collection->before[place].told &&
	    collection->before[place].kind == now->kind &&
	    collection->before[place].bits == now->bits && now->kind != DB_NAMED_TEXT)
		return;
	db_values_collect(collection->values, name, entry, value);
}

/* Its values, if there are new ones; null. */
static json_t *sample(struct db_session *session, struct stream *stream, size_t place)
{
	struct db_registers *registers = session->control->setup.registers;
	const struct choice *choice = &stream->choices[stream->drives[place].choice];
	uint16_t number = stream->drives[place].number;
	struct db_named_moment moment = db_named_moment(registers, number);
	struct db_client nobody = session->client;
	/* Of a drive that was added later all values are sent each time: it has no place here. */
	struct told *told = place < stream->told_count / stream->told_places ?
	                            &stream->told[place * stream->told_places] :
	                            NULL;
	struct collection collection = { .before = told };
	json_int_t lost;

	if (stream->interval == 0 && moment.taken == stream->drives[place].taken)
		return NULL;
	stream->drives[place].taken = moment.taken;
	/* A reader that does not take what it requested. */
	if (session->out)
		return json_null();
	/* A stream continues by itself and does not show that its reader is alive: it feeds no
	 * watchdog. */
	nobody.may_write = false;
	collection.values = json_object();
	db_named_read(registers, &nobody, number, choice->entries, choice->count, &moment, collect,
	              &collection);
	if (told)
		memcpy(told, collection.now, collection.count * sizeof(*told));
	lost = stream->drives[place].begun ?
	               (json_int_t)(moment.samples - stream->drives[place].samples) - 1 :
	               0;
	stream->drives[place].begun = true;
	stream->drives[place].taken = moment.taken;
	stream->drives[place].samples = moment.samples;
	return json_pack("{s:s, s:I, s:I, s:o}", "drive", db_named_name(registers, number),
	                 "time_us", (json_int_t)moment.wall_us, "lost", lost > 0 ? lost : 0,
	                 "values", collection.values);
}

static void send_samples(struct db_session *session, db_time now)
{
	struct db_registers *registers = session->control->setup.registers;
	struct stream *stream = session->job;
	bool full = session->out != NULL;
	json_t *samples;

	if (stream->generation != db_named_generation(registers))
		find_again(stream, registers);
	session->due = session->due + stream->period > now ? session->due + stream->period :
	                                                     now + stream->period;
	samples = json_array();
	for (size_t i = 0; i < stream->drive_count; i++) {
		json_t *one = sample(session, stream, i);

		if (one)
			json_array_append_new(samples, one);
	}
	if (full || (stream->interval == 0 && json_array_size(samples) == 0)) {
		stream->skipped += full && json_array_size(samples) > 0;
		session->control->stats.skipped += full && json_array_size(samples) > 0;
		json_decref(samples);
		return;
	}
	db_session_reply(session,
	                 json_pack("{s:I, s:o, s:I, s:o}", "time_us",
	                           (json_int_t)db_clock_wall_us(), "samples", samples, "skipped",
	                           (json_int_t)stream->skipped, "token",
	                           db_held_token(session->control)),
	                 true);
	stream->skipped = 0;
}

/* --- Events ----------------------------------------------------------------------------------- */

static void set_if_any(json_t *event, const char *key, const char *text)
{
	if (text[0] != '\0')
		json_object_set_new(event, key, db_values_text(text));
}

json_t *db_streams_event(const struct db_log_line *line)
{
	static const char *const levels[] = {
		[DB_LOG_ERROR] = "error",
		[DB_LOG_WARNING] = "warning",
		[DB_LOG_NOTICE] = "notice",
		[DB_LOG_INFO] = "info",
	};
	json_t *text = json_string(line->text);
	json_t *event = json_pack(
		"{s:I, s:I, s:s, s:s, s:o}", "number", (json_int_t)line->number, "time_us",
		(json_int_t)line->time_us, "level", levels[db_event_level(line->event)], "name",
		db_event_name(line->event), "text", text ? text : db_values_text(line->text));

	set_if_any(event, "bus", line->bus);
	set_if_any(event, "drive", line->drive);
	set_if_any(event, "client", line->client);
	return event;
}

/* Sends at most this number of events that the session has not received. */
static void send_events(struct db_session *session, size_t most)
{
	json_t *events = json_array();
	struct db_log_line line;
	uint64_t skipped = 0;

	while (json_array_size(events) < most &&
	       db_log_recent(session->control->log.log, session->next_event, &line)) {
		/* Events before the first one requested do not count as missed. */
		if (session->next_event > 0)
			skipped += line.number - session->next_event;
		session->next_event = line.number + 1;
		json_array_append_new(events, db_streams_event(&line));
	}
	session->control->stats.skipped += skipped;
	db_session_reply(session,
	                 json_pack("{s:o, s:I}", "events", events, "skipped", (json_int_t)skipped),
	                 session->more);
}

void db_streams_events(const struct db_call *call)
{
	struct db_session *session = call->session;

	session->next_event = 0;
	if (session->more) {
		session->wait = DB_WAITS_FOR_EVENTS;
		session->due = db_control_now(session->control) + EVENTS_INTERVAL;
	}
	send_events(session, DB_LOG_RECENT);
	if (session->next_event == 0)
		session->next_event = 1;
}

void db_streams_look(struct db_session *session, db_time now)
{
	struct db_log_line line;

	if (session->wait == DB_WAITS_FOR_VALUES) {
		send_samples(session, now);
		return;
	}
	session->due = now + EVENTS_INTERVAL;
	/* A slow reader gets the rest later, as far as it is kept. */
	while (!session->out && !session->broken &&
	       db_log_recent(session->control->log.log, session->next_event, &line)) {
		send_events(session, 1);
		if (!db_session_send(session, now))
			session->broken = true;
	}
}

/* --- Reload ----------------------------------------------------------------------------------- */

void db_streams_reload(const struct db_call *call)
{
	struct db_session *session = call->session;
	struct db_control_socket *control = session->control;

	if (!db_session_require_act(session))
		return;
	db_session_record(session, &(struct db_audit_entry){
					   .kind = DB_AUDIT_RELOAD,
					   .what = "asked for",
				   });
	/* Set before the request: the reload may end at once. */
	session->wait = DB_WAITS_FOR_RELOAD;
	session->reloads = 1;
	if (!control->setup.ops->reload(control->setup.context))
		session->reloads = 2;
}

void db_streams_reloaded(struct db_session *session, const char *errors)
{
	if (session->wait != DB_WAITS_FOR_RELOAD || --session->reloads > 0)
		return;
	db_session_reply(session,
	                 json_pack("{s:o}", "messages", db_message_lines(errors ? errors : "")),
	                 false);
}
