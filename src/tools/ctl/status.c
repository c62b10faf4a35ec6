/* SPDX-License-Identifier: Apache-2.0 */
#include "ctl/ctl_private.h"
#include "ctl/plant.h"
#include "ctl/say.h"
#include "words/value.h"

#include <poll.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

/* As drivebridge-tls begins to say it in its log. */
#define CERTIFICATE_SOON_S ((time_t)30 * 24 * 3600)

struct row {
	const json_t *drive; /* of the description */
	const json_t *registers;
	json_t *values;
	const json_t *trouble; /* the service's record of it; null: it has none */
	struct db_ctl_judgement judgement;
	size_t place; /* its index in the configuration */
};

/* Numbers of drives and buses by what they need; the configuration counts as one more. */
struct sum {
	size_t count[DB_CLIENT_ACT + 1];
};

static void keep_values(void *data, json_t *parameters, const struct db_client_error *error,
                        bool more)
{
	struct row *row = data;

	(void)more;
	/* A drive that was removed between two calls counts as one that does not answer. */
	row->values = error ? NULL : json_incref(json_object_get(parameters, "values"));
}

static void keep_troubles(void *data, json_t *parameters, const struct db_client_error *error,
                          bool more)
{
	struct db_client_troubles *troubles = data;

	(void)more;
	if (!error)
		db_client_troubles_take(troubles, parameters);
}

/* All drives at once: one round trip for any number. */
static enum db_ctl_status read_all(struct db_ctl *ctl, struct row *rows, size_t count,
                                   struct db_client_troubles *troubles)
{
	for (size_t i = 0; i < count; i++) {
		json_t *names = db_ctl_process_names(rows[i].registers);
		json_t *parameters;

		db_ctl_add_learnt_names(names, rows[i].registers);
		parameters = json_pack("{s:s, s:o}", "drive", db_words_text(rows[i].drive, "name"),
		                       "names", names);
		(void)db_client_send(ctl->client, "Read", parameters, false, keep_values, &rows[i]);
	}
	(void)db_client_send(ctl->client, "Troubles", json_pack("{s:[]}", "drives"), false,
	                     keep_troubles, troubles);
	while (db_client_waiting(ctl->client) > 0) {
		struct pollfd poll_fd = db_client_poll_fd(ctl->client);

		if (poll(&poll_fd, 1, DB_CTL_TIMEOUT_MS) <= 0)
			return db_ctl_complain(ctl, DB_CTL_UNREACHABLE, DB_CLIENT_TIMEOUT,
			                       "the service does not answer within %d ms",
			                       DB_CTL_TIMEOUT_MS);
		if (db_client_handle(ctl->client) != 0)
			return db_ctl_complain(ctl, DB_CTL_UNREACHABLE, DB_CLIENT_LOST,
			                       "the service has closed the connection");
	}
	return DB_CTL_OK;
}

/* The worst first, else in the order of the configuration. */
static int compare_rows(const void *a, const void *b)
{
	const struct row *one = a;
	const struct row *other = b;

	if (one->judgement.need != other->judgement.need)
		return one->judgement.need > other->judgement.need ? -1 : 1;
	return one->place < other->place ? -1 : 1;
}

static json_t *describe_row(const struct row *row)
{
	json_t *object = json_deep_copy(row->drive);
	const json_t *state = json_object_get(row->values, "axis_state");
	const char *state_name = json_is_integer(state) ?
	                                 db_words_code_name(
						 db_words_look_up(row->registers, "axis_state"),
						 json_integer_value(state)) :
	                                 NULL;

	(void)json_object_set_new(object, "state",
	                          state_name ? json_string(state_name) : json_null());
	(void)json_object_set_new(object, "need",
	                          json_string(db_client_needs[row->judgement.need]));
	(void)json_object_set_new(object, "why", json_string(row->judgement.why));
	(void)json_object_set_new(object, "next", json_string(row->judgement.next));
	(void)json_object_set_new(object, "trouble",
	                          row->trouble ? json_deep_copy(row->trouble) : json_null());
	(void)json_object_set_new(object, "values",
	                          row->values ? json_incref(row->values) : json_object());
	return object;
}

static void print_as_json(const struct db_ctl *ctl, const struct row *rows, size_t count, bool well)
{
	static const char *const of_configuration[] = {
		"configuration_state",
		"configuration_since_us",
		"configuration_messages",
		"restart_needed",
		"audit_trouble",
		"health_trouble",
		"secure",
	};
	json_t *buses = json_object_get(ctl->description, "buses");
	json_t *drives = json_array();
	json_t *object;

	for (size_t i = 0; i < count; i++)
		(void)json_array_append_new(drives, describe_row(&rows[i]));
	object = json_pack("{s:s, s:s, s:b, s:O, s:o}", "version",
	                   db_words_text(ctl->description, "version"), "configuration",
	                   db_words_text(ctl->description, "configuration"), "well", well, "buses",
	                   buses, "drives", drives);
	for (size_t i = 0; i < sizeof(of_configuration) / sizeof(of_configuration[0]); i++) {
		json_t *value = json_object_get(ctl->description, of_configuration[i]);

		if (value)
			(void)json_object_set(object, of_configuration[i], value);
	}
	db_ctl_print_json(object);
	json_decref(object);
}

static void print_advice(const struct db_ctl *ctl, const char *kind, const char *name,
                         const struct db_ctl_judgement *judgement)
{
	enum db_ctl_colour colour = judgement->need == DB_CLIENT_ACT  ? DB_CTL_RED :
	                            judgement->need == DB_CLIENT_LOOK ? DB_CTL_YELLOW :
	                                                                DB_CTL_PLAIN;

	char why[DB_WORDS_TEXT_MAX];
	char next[DB_WORDS_TEXT_MAX];
	char text[2 * DB_WORDS_TEXT_MAX];

	if (judgement->need == DB_CLIENT_FINE)
		return;
	snprintf(text, sizeof(text), "%s%s%s%s: %s: %s", db_ctl_colour_begin(ctl->colour, colour),
	         db_ctl_say(kind), name, db_ctl_colour_end(ctl->colour, colour),
	         db_ctl_translate(db_ctl_say_name(judgement->why), why),
	         db_ctl_translate(judgement->next, next));
	db_ctl_wrap(stdout, db_ctl_width(stdout), 0, 4, text);
}

/* Prints since when, and the latest event about it. */
static void print_record(const json_t *trouble)
{
	json_int_t since = json_integer_value(json_object_get(trouble, "since_us"));
	const json_t *event = json_object_get(trouble, "event");
	char when[DB_WORDS_TIME_MAX];
	char room[DB_WORDS_TEXT_MAX];
	char text[2 * DB_WORDS_TEXT_MAX];
	size_t used;

	/* The time of a hint does not matter. */
	if (since == 0 || db_client_trouble_need(trouble) <= DB_CLIENT_HINT)
		return;
	db_words_write_time(since, when);
	used = (size_t)snprintf(text, sizeof(text), db_ctl_say("since %s"), when);
	if (json_is_object(event))
		snprintf(text + used, sizeof(text) - used, ": %s",
		         db_ctl_translate(db_words_text(event, "text"), room));
	db_ctl_wrap(stdout, db_ctl_width(stdout), 2, 4, text);
}

/* The mistakes in its files are listed below, one per line. */
static void print_configuration(const struct db_ctl *ctl, const json_t *trouble)
{
	struct db_ctl_judgement judgement;
	char room[DB_WORDS_TEXT_MAX];
	size_t i;
	const json_t *message;

	db_ctl_judge(trouble, &judgement);
	print_advice(ctl, "", db_ctl_say("configuration"), &judgement);
	print_record(trouble);
	json_array_foreach(json_object_get(trouble, "errors"), i, message)
		db_ctl_wrap(stdout, db_ctl_width(stdout), 2, 4,
	                    db_ctl_translate(json_string_value(message), room));
}

/* "all is well", "no faults, 1 hint", "2 to act on, 1 to look at". */
static void print_sum(const struct db_ctl *ctl, const struct sum *sum)
{
	size_t act = sum->count[DB_CLIENT_ACT];
	size_t look = sum->count[DB_CLIENT_LOOK];
	size_t hints = sum->count[DB_CLIENT_HINT];
	enum db_ctl_colour colour = sum->count[DB_CLIENT_ACT] > 0  ? DB_CTL_RED :
	                            sum->count[DB_CLIENT_LOOK] > 0 ? DB_CTL_YELLOW :
	                                                             DB_CTL_GREEN;
	const char *gap = "";

	fputs(db_ctl_colour_begin(ctl->colour, colour), stdout);
	if (colour == DB_CTL_GREEN)
		fputs(hints > 0 ? db_ctl_say("no faults, ") : db_ctl_say("all is well"), stdout);
	if (act > 0)
		printf(db_ctl_say("%zu to act on"), act);
	gap = act > 0 ? ", " : gap;
	if (look > 0) {
		fputs(gap, stdout);
		printf(db_ctl_say("%zu to look at"), look);
		gap = ", ";
	}
	if (hints > 0) {
		fputs(gap, stdout);
		printf(db_ctl_say_count(hints, "%zu hint", "%zu hints"), hints);
	}
	printf("%s\n", db_ctl_colour_end(ctl->colour, colour));
}

/* True if the drive has the trouble of its bus, which is printed and counted once. */
static bool has_trouble_of_bus(const struct row *row, const struct db_client_troubles *troubles)
{
	const json_t *bus = json_object_get(troubles->buses, db_words_text(row->drive, "bus"));

	return row->judgement.need != DB_CLIENT_FINE &&
	       strcmp(db_words_text(bus, "cause"), row->judgement.cause) == 0;
}

/* The number of each need; `hints` of the gateway itself are among them. */
static struct sum add_up(const struct db_ctl *ctl, const struct row *rows, size_t count,
                         const struct db_client_troubles *troubles, size_t hints)
{
	struct sum sum = { .count = { [DB_CLIENT_HINT] = hints } };
	size_t i;
	const json_t *bus;

	for (size_t at = 0; at < count; at++) {
		if (!has_trouble_of_bus(&rows[at], troubles))
			sum.count[rows[at].judgement.need]++;
	}
	json_array_foreach(json_object_get(ctl->description, "buses"), i, bus)
	{
		const json_t *trouble = json_object_get(troubles->buses,
		                                        db_words_text(bus, "name"));

		sum.count[db_client_trouble_need(trouble)]++;
	}
	sum.count[db_client_trouble_need(troubles->configuration)]++;
	return sum;
}

/* What follows prints hints about the gateway and returns how many. */

/* Of the service's own files. Drives and clients do not notice. */
static size_t print_files(const struct db_ctl *ctl)
{
	const char *replaced = db_words_text(ctl->description, "restart_needed");
	const char *audit = db_words_text(ctl->description, "audit_trouble");
	const char *health = db_words_text(ctl->description, "health_trouble");
	char texts[3][1024] = { "", "", "" };
	size_t hints = 0;

	/* The running configuration continues, and only people know when the machine may stop. */
	if (replaced[0])
		snprintf(texts[0], sizeof(texts[0]),
		         db_ctl_say("an upgrade has replaced %s: systemctl restart "
		                    "drivebridge when the machine may stand still"),
		         replaced);
	if (audit[0])
		snprintf(texts[1], sizeof(texts[1]),
		         db_ctl_say("the audit trail cannot be written: %s; its records are "
		                    "only in the journal"),
		         audit);
	if (health[0])
		snprintf(texts[2], sizeof(texts[2]),
		         db_ctl_say("health values and alarms cannot be written: %s; they "
		                    "are in memory only"),
		         health);
	for (size_t i = 0; i < sizeof(texts) / sizeof(texts[0]); i++) {
		if (!texts[i][0])
			continue;
		db_ctl_wrap(stdout, db_ctl_width(stdout), 0, 4, texts[i]);
		hints++;
	}
	return hints;
}

/* People have this long to renew them. */
static size_t print_certificates(const struct db_ctl *ctl)
{
	static const struct {
		const char *name;
		const char *what;
	} ends[] = {
		{ "ends", DB_CTL_TEXT("the gateway's certificate ends") },
		{ "client_ends", DB_CTL_TEXT("the certificate of a connected client ends") },
		{ "list_due", DB_CTL_TEXT("a newer list of revoked certificates is due") },
	};
	const json_t *secure = json_object_get(ctl->description, "secure");
	time_t now = time(NULL);
	size_t hints = 0;

	for (size_t i = 0; i < sizeof(ends) / sizeof(ends[0]); i++) {
		time_t moment = (time_t)json_integer_value(json_object_get(secure, ends[i].name));
		struct tm parts;
		char date[32];

		if (moment == 0 || moment - now > CERTIFICATE_SOON_S ||
		    !gmtime_r(&moment, &parts) ||
		    strftime(date, sizeof(date), "%Y-%m-%d %H:%M UTC", &parts) == 0)
			continue;
		printf(db_ctl_say("%s on %s: see drivebridge-tls(8)"), db_ctl_say(ends[i].what),
		       date);
		fputc('\n', stdout);
		hints++;
	}
	return hints;
}

static void print_learnt(const struct db_ctl *ctl, const struct row *rows, size_t count)
{
	struct db_ctl_learnt *drives = calloc(count + 1, sizeof(*drives));
	size_t i;
	const json_t *bus;

	if (!drives)
		return;
	for (size_t at = 0; at < count; at++)
		drives[at] = (struct db_ctl_learnt){ rows[at].drive, rows[at].values };
	json_array_foreach(json_object_get(ctl->description, "buses"), i, bus)
	{
		db_ctl_print_learnt(bus, drives, count);
	}
	free(drives);
}

static void print_for_people(const struct db_ctl *ctl, const struct row *rows, size_t count,
                             const struct db_client_troubles *troubles)
{
	struct db_ctl_grid *grid = db_ctl_grid_new(DB_CTL_DRIVE_COLUMNS);
	struct db_ctl_judgement judgement;
	size_t hints;
	size_t i;
	const json_t *bus;

	if (!grid)
		return;
	if (count > 0)
		db_ctl_add_heads(grid);
	for (size_t at = 0; at < count; at++)
		db_ctl_add_drive(grid, rows[at].drive, rows[at].registers, rows[at].values,
		                 &rows[at].judgement);
	db_ctl_fit_drives(grid, db_ctl_width(stdout));
	db_ctl_grid_print(grid, ctl->colour, db_ctl_width(stdout), "\n", stdout);
	db_ctl_grid_free(grid);
	if (count == 0)
		puts(db_ctl_say("no drives yet: the configuration has none, see "
		                "drivebridge.conf(5)"));
	else
		putchar('\n');
	if (!troubles->told)
		puts(db_ctl_say("this service is older than drivebridgectl and does not say "
		                "what is wrong: restart it as soon as the drives may stop"));
	print_configuration(ctl, troubles->configuration);
	hints = print_files(ctl);
	hints += print_certificates(ctl);
	json_array_foreach(json_object_get(ctl->description, "buses"), i, bus)
	{
		const char *name = db_words_text(bus, "name");
		const json_t *trouble = json_object_get(troubles->buses, name);

		db_ctl_judge(trouble, &judgement);
		print_advice(ctl, "bus ", name, &judgement);
		print_record(trouble);
	}
	for (size_t at = 0; at < count; at++) {
		if (has_trouble_of_bus(&rows[at], troubles))
			continue;
		print_advice(ctl, "", db_words_text(rows[at].drive, "name"), &rows[at].judgement);
		print_record(rows[at].trouble);
	}
	print_learnt(ctl, rows, count);
	if (troubles->told && count > 0) {
		struct sum sum = add_up(ctl, rows, count, troubles, hints);

		print_sum(ctl, &sum);
	}
}

enum db_ctl_status db_ctl_status(struct db_ctl *ctl, int count, char **arguments)
{
	json_t *drives = json_object_get(ctl->description, "drives");
	size_t drive_count = json_array_size(drives);
	struct row *rows = calloc(drive_count + 1, sizeof(*rows));
	enum db_ctl_status status = DB_CTL_OK;
	json_t *families = db_ctl_read_families(ctl, &status);
	struct db_client_troubles troubles = { .told = false };
	size_t i;

	(void)count;
	(void)arguments;
	for (i = 0; rows && i < drive_count; i++) {
		rows[i].drive = json_array_get(drives, i);
		rows[i].registers = db_ctl_registers_of(ctl, families, rows[i].drive);
		rows[i].place = i;
	}
	if (rows && status == DB_CTL_OK)
		status = read_all(ctl, rows, drive_count, &troubles);
	if (rows && status == DB_CTL_OK) {
		for (i = 0; i < drive_count; i++) {
			rows[i].trouble = json_object_get(troubles.drives,
			                                  db_words_text(rows[i].drive, "name"));
			db_ctl_judge(rows[i].trouble, &rows[i].judgement);
		}
		qsort(rows, drive_count, sizeof(*rows), compare_rows);
		if (ctl->json)
			print_as_json(ctl, rows, drive_count, troubles.well);
		else
			print_for_people(ctl, rows, drive_count, &troubles);
		status = troubles.well ? DB_CTL_OK : DB_CTL_NO;
	}
	for (i = 0; rows && i < drive_count; i++)
		json_decref(rows[i].values);
	free(rows);
	json_decref(families);
	db_client_troubles_clear(&troubles);
	return status;
}
