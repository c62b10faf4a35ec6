/* SPDX-License-Identifier: Apache-2.0 */
/*
 * Puts a new drive in the place of a broken one: finds it on the bus, gives it the configured
 * address (and speed), and restores the parameters that were saved from the old one. The steps are
 * the commands scan, baud, address and params restore. Each step first checks what is already done,
 * so that the same command continues after any interruption.
 */
#include "ctl/ctl_private.h"
#include "ctl/params_source.h"
#include "ctl/plant.h"
#include "ctl/say.h"
#include "ctl/search.h"
#include "words/value.h"

#include <limits.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

#define ONLINE_WITHIN_S 60

struct replacement {
	struct db_ctl *ctl;
	const json_t *drive;
	const json_t *bus;
	const json_t *registers; /* of the drive's family */
	char path[PATH_MAX];     /* of the file with the saved parameters */
	struct db_params file;
};

static const char *name_of(const struct replacement *of)
{
	return db_words_text(of->drive, "name");
}

static void tell_step(const struct replacement *of, int number, const char *what)
{
	if (!of->ctl->json) {
		putchar('\n');
		db_ctl_say_line(stdout, "step %d of 3: %s", number, db_ctl_say(what));
	}
	(void)fflush(stdout);
}

/* Which drive answers at one address in service. */
static enum db_ctl_status look_at_place(const struct replacement *of, struct db_ctl_search *search)
{
	json_int_t address = db_words_number(of->drive, "address");
	enum db_ctl_status status = db_ctl_search(of->ctl,
	                                          json_pack("{s:s, s:I, s:I}", "bus",
	                                                    db_words_text(of->bus, "name"), "first",
	                                                    address, "last", address),
	                                          search);

	if (status == DB_CTL_OK && search->interrupted)
		status = db_ctl_complain(of->ctl, DB_CTL_NO, "io.drivebridge.Client.Interrupted",
		                         "interrupted; nothing was changed");
	return status;
}

/* Scans the whole bus, or the given addresses. */
static enum db_ctl_status look_for_new(const struct replacement *of, struct db_ctl_search *search)
{
	struct db_ctl *ctl = of->ctl;
	json_t *parameters = json_pack("{s:s, s:b}", "bus", db_words_text(of->bus, "name"),
	                               "all_speeds", ctl->all_speeds);
	enum db_ctl_status status = DB_CTL_OK;
	unsigned first;
	unsigned last;
	char end;

	*search = (struct db_ctl_search){ .finds = NULL };
	if (ctl->addresses && sscanf(ctl->addresses, "%u-%u%c", &first, &last, &end) == 2) {
		(void)json_object_set_new(parameters, "first", json_integer(first));
		(void)json_object_set_new(parameters, "last", json_integer(last));
	} else if (ctl->addresses) {
		status = db_ctl_complain(ctl, DB_CTL_USAGE, "io.drivebridge.Client.Usage",
		                         "\"%s\" are no addresses; 1-32, for instance, are",
		                         ctl->addresses);
	}
	if (status == DB_CTL_OK && ctl->all_speeds)
		status = db_ctl_ask(
			ctl,
			"bus %s is taken out of service for this, and all of its drives are "
			"offline meanwhile; go on?",
			db_words_text(of->bus, "name"));
	if (status != DB_CTL_OK) {
		json_decref(parameters);
		return status;
	}
	status = db_ctl_search(ctl, parameters, search);
	if (status == DB_CTL_OK && search->interrupted)
		status = db_ctl_complain(ctl, DB_CTL_NO, "io.drivebridge.Client.Interrupted",
		                         "interrupted; nothing was changed");
	return status;
}

/* The one drive found that has no section in the configuration, or the reason is printed. */
static const json_t *choose_new(const struct replacement *of, const struct db_ctl_search *search)
{
	const json_t *found = NULL;
	size_t count = 0;
	char list[256] = "";
	char unclear[256] = "";
	size_t i;
	const json_t *find;

	json_array_foreach(search->finds, i, find)
	{
		bool one = strcmp(db_words_text(find, "verdict"), "one") == 0;
		char *text = one ? list : unclear;
		size_t used = strlen(text);

		if (one && json_array_size(json_object_get(find, "drives")) > 0)
			continue;
		snprintf(text + used, sizeof(list) - used, "%s%lld", used > 0 ? ", " : "",
		         (long long)db_words_number(find, "address"));
		found = one ? find : found;
		count += one ? 1 : 0;
	}
	if (count == 1)
		return found;
	if (count > 1)
		(void)db_ctl_complain(of->ctl, DB_CTL_NO, "io.drivebridge.Client.NotOne",
		                      "several drives answer that are not in the configuration, at "
		                      "addresses %s: say which with --addresses N-N, or connect "
		                      "only the new one",
		                      list);
	else if (unclear[0])
		(void)db_ctl_complain(
			of->ctl, DB_CTL_NO, "io.drivebridge.Client.NotOne",
			"no new drive answers alone; at address %s there are two, or "
			"the line is disturbed: the new drive may have the address of "
			"another one. Take that one off the line until this is done",
			unclear);
	else
		(void)db_ctl_complain(of->ctl, DB_CTL_NO, "io.drivebridge.Client.NotOne",
		                      "no new drive answers: check its power and its cable%s",
		                      of->ctl->all_speeds ?
		                              "" :
		                              DB_CTL_TEXT("; it may have another baud rate: "
		                                          "--all-bauds looks there, too"));
	return NULL;
}

/* First its speed, with the bus out of service; then the address in service. */
static enum db_ctl_status set_up(const struct replacement *of, const json_t *find)
{
	struct db_ctl *ctl = of->ctl;
	char bus[256];
	char from[24];
	char to[24];
	char speed[24];
	char other[24];
	char *of_speed[] = { bus, from, speed, NULL };
	char *of_address[] = { bus, from, to, NULL };
	enum db_ctl_status status = DB_CTL_OK;

	snprintf(bus, sizeof(bus), "%s", db_words_text(of->bus, "name"));
	snprintf(from, sizeof(from), "%lld", (long long)db_words_number(find, "address"));
	snprintf(to, sizeof(to), "%lld", (long long)db_words_number(of->drive, "address"));
	snprintf(speed, sizeof(speed), "%lld",
	         json_integer_value(json_object_get(of->bus, "speed")));
	snprintf(other, sizeof(other), "%lld", json_integer_value(json_object_get(find, "speed")));
	if (strcmp(other, speed) != 0) {
		ctl->speed = other;
		status = db_ctl_baud(ctl, 3, of_speed);
		ctl->speed = NULL;
	}
	if (status == DB_CTL_OK &&
	    db_words_number(find, "address") != db_words_number(of->drive, "address"))
		status = db_ctl_address(ctl, 3, of_address);
	return status;
}

/* Ensures that one drive, and a new one, is at the address of the broken one. */
static enum db_ctl_status bring_to_place(const struct replacement *of)
{
	struct db_ctl_search here = { .finds = NULL };
	struct db_ctl_search all = { .finds = NULL };
	enum db_ctl_status status = look_at_place(of, &here);
	const json_t *find = json_array_get(here.finds, 0);
	const char *verdict = db_words_text(find, "verdict");
	const char *identity = db_words_text(find, "identity");

	if (status == DB_CTL_OK && strcmp(verdict, "one") == 0) {
		/* From an earlier attempt, or it was delivered with this address. */
		if (!of->ctl->json)
			db_ctl_say_line(stdout, "a drive answers at address %lld%s%s",
			                (long long)db_words_number(of->drive, "address"),
			                identity[0] ? ": " : "", identity);
		status = db_ctl_ask(of->ctl, "is it the new one?");
	} else if (status == DB_CTL_OK && verdict[0]) {
		status = db_ctl_complain(of->ctl, DB_CTL_NO, "io.drivebridge.Client.NotOne",
		                         "more than one drive answers at address %lld of %s: take "
		                         "the old one off the line",
		                         (long long)db_words_number(of->drive, "address"),
		                         db_words_text(of->bus, "name"));
	} else if (status == DB_CTL_OK) {
		status = look_for_new(of, &all);
		find = status == DB_CTL_OK ? choose_new(of, &all) : NULL;
		if (status == DB_CTL_OK)
			status = find ? set_up(of, find) : DB_CTL_NO;
	}
	db_ctl_search_clear(&here);
	db_ctl_search_clear(&all);
	return status;
}

/* True when the service knows it: it is online, and its parameters are known. */
static bool is_known(const struct replacement *of, enum db_ctl_status *status)
{
	json_t *answer = db_ctl_call(
		of->ctl, "Read", json_pack("{s:s, s:[s]}", "drive", name_of(of), "names", "status"),
		DB_CTL_TIMEOUT_MS, status);
	const json_t *bits = json_object_get(json_object_get(answer, "values"), "status");
	const json_t *reg = db_words_look_up(of->registers, "status");
	bool known = db_words_has_bit(reg, bits, "online") &&
	             db_words_has_bit(reg, bits, "params_valid");

	json_decref(answer);
	return known;
}

static enum db_ctl_status wait_until_known(const struct replacement *of)
{
	const struct timespec pause = { .tv_nsec = 100000000 };
	time_t until = time(NULL) + ONLINE_WITHIN_S;
	enum db_ctl_status status = DB_CTL_OK;

	while (!is_known(of, &status)) {
		if (status != DB_CTL_OK)
			return status;
		if (time(NULL) > until)
			return db_ctl_complain(of->ctl, DB_CTL_NO, "io.drivebridge.Client.Timeout",
			                       "%s does not come online within %d s; see "
			                       "drivebridgectl status. The same command goes on",
			                       name_of(of), ONLINE_WITHIN_S);
		(void)nanosleep(&pause, NULL);
	}
	return status;
}

static enum db_ctl_status carry_out(const struct replacement *of)
{
	struct db_ctl *ctl = of->ctl;
	enum db_ctl_status status = DB_CTL_OK;
	char drive[256];
	char path[PATH_MAX];
	char *words[] = { drive, path, NULL };

	if (!ctl->json)
		db_ctl_say_line(stdout, "%s: bus %s, address %lld; its parameters are in %s%s%s%s",
		                name_of(of), db_words_text(of->bus, "name"),
		                (long long)db_words_number(of->drive, "address"), of->path,
		                of->file.identity[0] ? " (" : "", of->file.identity,
		                of->file.identity[0] ? ")" : "");
	tell_step(of, 1, DB_CTL_TEXT("find the new drive and give it this address"));
	/* A line without addresses has no other place. */
	if (db_words_number(of->drive, "address") > 0)
		status = bring_to_place(of);
	if (status == DB_CTL_OK) {
		tell_step(of, 2, DB_CTL_TEXT("wait until the service knows it"));
		status = wait_until_known(of);
	}
	if (status == DB_CTL_OK) {
		tell_step(of, 3, DB_CTL_TEXT("write the parameters into it, and save them"));
		snprintf(drive, sizeof(drive), "%s", name_of(of));
		snprintf(path, sizeof(path), "%s", of->path);
		ctl->save = db_ctl_params_can_save(ctl, drive);
		status = db_ctl_params_restore(ctl, 2, words);
	}
	if (status == DB_CTL_OK && !ctl->json) {
		putchar('\n');
		db_ctl_say_line(stdout,
		                "%s is replaced. Where its position is counted from is new: home "
		                "it, or set its position, before it moves",
		                name_of(of));
	}
	return status;
}

enum db_ctl_status db_ctl_replace(struct db_ctl *ctl, int count, char **arguments)
{
	struct replacement of = { .ctl = ctl, .drive = db_ctl_find_drive(ctl, arguments[0]) };
	struct db_params place = { .values = NULL };
	enum db_ctl_status status = DB_CTL_USAGE;
	json_t *families = of.drive ? db_ctl_read_families(ctl, &status) : NULL;

	/* Check before any change what would otherwise fail only at the end. */
	if (families && status == DB_CTL_OK) {
		of.bus = db_words_look_up(json_object_get(ctl->description, "buses"),
		                          db_words_text(of.drive, "bus"));
		of.registers = db_ctl_registers_of(ctl, families, of.drive);
		snprintf(of.path, sizeof(of.path), "%s%s", count > 1 ? arguments[1] : arguments[0],
		         count > 1 ? "" : ".params");
		snprintf(place.name, sizeof(place.name), "%s", name_of(&of));
		snprintf(place.family, sizeof(place.family), "%s",
		         db_words_text(of.bus, "protocol"));
		status = db_ctl_params_read_file(ctl, families, of.path, &of.file);
	}
	if (status == DB_CTL_OK && of.drive)
		status = db_ctl_params_check_families(ctl, &of.file, &place);
	if (status == DB_CTL_OK && of.drive)
		status = carry_out(&of);
	db_params_clear(&of.file);
	json_decref(families);
	return status;
}
