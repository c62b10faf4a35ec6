/* SPDX-License-Identifier: Apache-2.0 */
#include "client/program.h"
#include "client/clock.h"
#include "client/log.h"
#include "drivebridge/version.h"
#include "upgrade/upgrade.h"
#include "users/administration.h"

#include <getopt.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

/* Longest time between two turns. */
#define TURN_MAX (1 * DB_NS_PER_S)

#define LOOK_FOR_UPGRADE_US (5 * UINT64_C(1000000))
#define LOOK_ACCURACY_US UINT64_C(1000000)

/* Most sources of events that are served before the next turn. */
#define SERVED_MAX 64

enum { HELP = DB_CLIENT_OPTIONS_MAX, VERSION, KNOWN };

int db_client_options_read(const char *program, const char *usage,
                           const struct db_client_option *options, int argc, char **argv)
{
	struct option known[KNOWN + 1] = {
		{ "help", no_argument, NULL, HELP },
		{ "version", no_argument, NULL, VERSION },
	};
	int option;

	for (int i = 0; i < DB_CLIENT_OPTIONS_MAX && options[i].name; i++)
		known[2 + i] = (struct option){
			.name = options[i].name,
			.has_arg = options[i].text ? required_argument : no_argument,
			.val = i,
		};
	while ((option = getopt_long(argc, argv, "", known, NULL)) != -1) {
		if (option == HELP) {
			fputs(usage, stdout);
			return EXIT_SUCCESS;
		}
		if (option == VERSION) {
			printf("%s %s\n", program, DB_VERSION);
			return EXIT_SUCCESS;
		}
		if (option == '?') {
			fputs(usage, stderr);
			return DB_CLIENT_EXIT_USAGE;
		}
		if (options[option].text)
			*options[option].text = optarg;
		else if (options[option].flag)
			*options[option].flag = true;
	}
	if (optind == argc)
		return -1;
	fputs(usage, stderr);
	return DB_CLIENT_EXIT_USAGE;
}

/* The place of a text in the configuration. */
static char **text_at(void *config, size_t offset)
{
	return (char **)((char *)config + offset);
}

/* True if they are good, or the program has none. `count`: how many there are. */
static bool check_users(const struct db_program *program, void *config, size_t *count)
{
	char former[512];
	struct db_users users;
	const char *path;
	bool good;

	*count = 0;
	if (!program->keeper)
		return true;
	path = *text_at(config, program->users_at);
	good = db_users_load(&users, path, program->keeper, stderr);
	*count = users.count;
	db_users_former(path, program->keeper, former, sizeof(former));
	if (users.former > 0)
		db_client_log(DB_CLIENT_WARNING,
		              "%zu users are still in %s; %s --move-users puts them into %s",
		              users.former, former, program->name, path);
	db_users_clear(&users);
	return good;
}

static int check(const struct db_program *program, const char *path, void *config)
{
	size_t count;
	bool good = check_users(program, config, &count);

	if (program->check && !program->check(config))
		good = false;
	if (good && program->keeper)
		printf("%s: OK; %zu users\n", path, count);
	else if (good)
		printf("%s: OK\n", path);
	return good ? EXIT_SUCCESS : DB_CLIENT_EXIT_CONFIG;
}

/* Told once: this code stays the old one. */
static int look_for_upgrade(sd_event_source *source, uint64_t us, void *data)
{
	char *replaced = db_upgrade_look();

	(void)us;
	(void)data;
	if (!replaced) {
		(void)sd_event_source_set_time_relative(source, LOOK_FOR_UPGRADE_US);
		return sd_event_source_set_enabled(source, SD_EVENT_ONESHOT);
	}
	db_client_log(DB_CLIENT_WARNING,
	              "%s was replaced since the start, but the old one still runs: restart this "
	              "program when the machine may stand still",
	              replaced);
	(void)sd_notify(0, "STATUS=an upgrade needs a restart");
	free(replaced);
	return 0;
}

static int serve(const struct db_program *program, void *config)
{
	sd_event *loop = NULL;
	int status = EXIT_FAILURE;
	size_t count;
	sigset_t set;

	(void)signal(SIGPIPE, SIG_IGN);
	(void)sigemptyset(&set);
	(void)sigaddset(&set, SIGTERM);
	(void)sigaddset(&set, SIGINT);
	(void)sigaddset(&set, SIGHUP);
	/* Before the first thread is created, so that all inherit it. */
	(void)sigprocmask(SIG_BLOCK, &set, NULL);
	(void)check_users(program, config, &count);
	srand((unsigned)(db_client_wall_us() ^ getpid()));
	if (sd_event_new(&loop) >= 0 &&
	    sd_event_add_time_relative(loop, NULL, CLOCK_MONOTONIC, LOOK_FOR_UPGRADE_US,
	                               LOOK_ACCURACY_US, look_for_upgrade, NULL) >= 0)
		status = program->serve(config, loop);
	else
		db_client_log(DB_CLIENT_ERROR, "out of memory");
	(void)sd_event_unref(loop);
	return status;
}

int db_program_main(const struct db_program *program, int argc, char **argv)
{
	const char *path = program->path;
	const char *text = NULL;
	struct db_users_task task = { .add = NULL };
	bool checks = false;
	struct db_client_option options[DB_CLIENT_OPTIONS_MAX] = {
		{ .name = "config", .text = &path },
		{ .name = "check", .flag = &checks },
	};
	size_t count = 2;
	int tasks;
	char host[64] = "gateway";
	void *config;
	int status;

	if (program->keeper) {
		const struct db_client_option more[] = {
			{ "add-user", &task.add, NULL },    { "remove-user", &task.remove, NULL },
			{ "role", &task.role, NULL },       { "drives", &task.drives, NULL },
			{ "pam", NULL, &task.pam },         { "users", NULL, &task.list },
			{ "move-users", NULL, &task.move },
		};

		memcpy(options + count, more, sizeof(more));
		count += sizeof(more) / sizeof(more[0]);
	}
	if (program->option)
		options[count] = (struct db_client_option){ program->option, &text, NULL };
	status = db_client_options_read(program->name, program->usage, options, argc, argv);
	if (status >= 0)
		return status;
	tasks = db_users_count_tasks(&task);
	if (tasks < 0) {
		fputs(program->usage, stderr);
		return DB_CLIENT_EXIT_USAGE;
	}
	config = calloc(1, program->form->size);
	if (!config) {
		db_client_log(DB_CLIENT_ERROR, "out of memory");
		return EXIT_FAILURE;
	}
	(void)gethostname(host, sizeof(host) - 1);
	if (!db_settings_load(program->form, path, stderr, config, host)) {
		status = DB_CLIENT_EXIT_CONFIG;
		goto end;
	}
	if (text) {
		free(*text_at(config, program->option_at));
		*text_at(config, program->option_at) = strdup(text);
	}
	if (tasks > 0)
		status = db_users_administer(program->keeper, *text_at(config, program->users_at),
		                             *(unsigned *)((char *)config + program->least_at),
		                             &task);
	else if (text && !*text_at(config, program->option_at))
		status = EXIT_FAILURE;
	else if (checks)
		status = check(program, path, config);
	else
		status = serve(program, config);
end:
	db_settings_free(program->form, config);
	free(config);
	return status;
}

/* --- the loop --------------------------------------------------------------------------------- */

struct hangup {
	db_program_renew_fn *renew;
	void *context;
};

static int on_hangup(sd_event_source *source, const struct signalfd_siginfo *info, void *data)
{
	const struct hangup *hangup = data;

	(void)source;
	(void)info;
	hangup->renew(hangup->context);
	return 0;
}

int db_program_loop(sd_event *loop, db_program_turn_fn *turn, db_program_renew_fn *renew,
                    void *context)
{
	struct hangup hangup = { .renew = renew, .context = context };
	sd_event_source *source = NULL;
	int result = 0;

	if (sd_event_add_signal(loop, NULL, SIGTERM, NULL, NULL) < 0 ||
	    sd_event_add_signal(loop, NULL, SIGINT, NULL, NULL) < 0 ||
	    sd_event_add_signal(loop, &source, SIGHUP, on_hangup, &hangup) < 0) {
		db_client_log(DB_CLIENT_ERROR, "out of memory");
		return EXIT_FAILURE;
	}
	(void)sd_event_set_watchdog(loop, true);
	(void)sd_notify(0, "READY=1");
	while (result >= 0 && sd_event_get_state(loop) != SD_EVENT_FINISHED) {
		db_time wait = turn(context, db_client_now(), db_client_wall_us()) -
		               db_client_now();
		unsigned served = 0;

		wait = wait < 0 ? 0 : wait > TURN_MAX ? TURN_MAX : wait;
		wait = (wait + DB_NS_PER_US - 1) / DB_NS_PER_US;
		/* Serves one source of events at a time. */
		do
			result = sd_event_run(loop, served == 0 ? (uint64_t)wait : 0);
		while (result > 0 && ++served < SERVED_MAX &&
		       sd_event_get_state(loop) != SD_EVENT_FINISHED);
	}
	(void)sd_notify(0, "STOPPING=1");
	sd_event_source_disable_unref(source);
	return result < 0 ? EXIT_FAILURE : EXIT_SUCCESS;
}

static int store_events(sd_event_source *source, int fd, uint32_t events, void *data)
{
	struct db_waker *waker = data;

	(void)source;
	(void)fd;
	waker->events = events;
	return 0;
}

void db_waker_arm(struct db_waker *waker, sd_event *loop, int fd, uint32_t events)
{
	if (fd >= 0 && sd_event_add_io(loop, &waker->source, fd, events, store_events, waker) >= 0)
		(void)sd_event_source_set_enabled(waker->source, SD_EVENT_ONESHOT);
}

uint32_t db_waker_take(struct db_waker *waker)
{
	uint32_t events = waker->events;

	waker->source = sd_event_source_disable_unref(waker->source);
	waker->events = 0;
	return events;
}
