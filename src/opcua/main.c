/* SPDX-License-Identifier: Apache-2.0 */
/*
 * drivebridge-opcua: the drives in the address space of an OPC UA server. A client of the control socket of
 * drivebridged and of nothing else.
 */
#include "client/clock.h"
#include "client/log.h"
#include "client/options.h"
#include "opcua/access.h"
#include "opcua/server.h"
#include "users/administration.h"

#include <errno.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/signalfd.h>
#include <systemd/sd-daemon.h>
#include <time.h>
#include <unistd.h>

#define CONFIG_PATH "/etc/drivebridge/opcua.conf"

/* The loop goes around at least so often, for the watchdog of systemd. */
#define TURN_MAX (1 * DB_NS_PER_S)

static const char usage[] =
	"usage: drivebridge-opcua [--config FILE] [--check]\n"
	"       drivebridge-opcua [--config FILE] --add-user NAME --role reader|operator\n"
	"       drivebridge-opcua [--config FILE] --remove-user NAME\n"
	"  --config FILE       what to serve to whom; " CONFIG_PATH " when not given\n"
	"  --check             check the file and the users, and end\n"
	"  --add-user NAME     make a user, or give one another password and role;\n"
	"                      the password is asked for, or a line of standard input\n"
	"  --remove-user NAME  take a user away\n"
	"  --help, --version\n";

/* Until a signal ends it. */
static int run(struct db_opcua_server *server, int signals)
{
	size_t places = db_opcua_server_places(server) + 1;
	struct pollfd *fds = calloc(places, sizeof(*fds));

	if (!fds)
		return EXIT_FAILURE;
	(void)sd_notify(0, "READY=1");
	for (;;) {
		db_time now = db_client_now();
		db_time wait = db_opcua_server_due(server, now) - now;
		struct timespec patience;
		size_t used;

		wait = wait < 0 ? 0 : wait > TURN_MAX ? TURN_MAX : wait;
		patience = (struct timespec){ .tv_sec = wait / DB_NS_PER_S,
			                      .tv_nsec = wait % DB_NS_PER_S };
		fds[0] = (struct pollfd){ .fd = signals, .events = POLLIN };
		used = db_opcua_server_watch(server, fds + 1, places - 1);
		if (ppoll(fds, used + 1, &patience, NULL) < 0 && errno != EINTR)
			break;
		if (fds[0].revents != 0)
			break;
		db_opcua_server_handle(server, db_client_now(), db_client_wall_us());
		(void)sd_notify(0, "WATCHDOG=1");
	}
	(void)sd_notify(0, "STOPPING=1");
	free(fds);
	return EXIT_SUCCESS;
}

static int check(const char *path, const struct db_opcua_config *config)
{
	struct db_users users;
	bool good = db_users_load(&users, config->users, &db_opcua_keeper, stderr);

	if (good)
		(void)printf("%s: it is good; %zu users\n", path, users.count);
	db_users_clear(&users);
	return good ? EXIT_SUCCESS : DB_CLIENT_EXIT_CONFIG;
}

static int open_signals(void)
{
	sigset_t set;

	(void)sigemptyset(&set);
	(void)sigaddset(&set, SIGTERM);
	(void)sigaddset(&set, SIGINT);
	(void)sigprocmask(SIG_BLOCK, &set, NULL);
	return signalfd(-1, &set, SFD_NONBLOCK | SFD_CLOEXEC);
}

int main(int argc, char **argv)
{
	const char *path = CONFIG_PATH;
	struct db_users_task task = { .add = NULL };
	bool checks = false;
	const struct db_client_option options[] = {
		{ .name = "config", .text = &path },
		{ .name = "check", .flag = &checks },
		{ .name = "add-user", .text = &task.add },
		{ .name = "remove-user", .text = &task.remove },
		{ .name = "role", .text = &task.role },
		{ .name = NULL },
	};
	struct db_opcua_server *server;
	struct db_opcua_config config;
	char host[64] = "gateway";
	int status = db_client_options_read("drivebridge-opcua", usage, options, argc, argv);
	int signals;

	if (status >= 0)
		return status;
	if (!db_users_task_is_good(&task)) {
		(void)fputs(usage, stderr);
		return DB_CLIENT_EXIT_USAGE;
	}
	(void)gethostname(host, sizeof(host) - 1);
	if (!db_opcua_config_load(path, host, stderr, &config)) {
		db_opcua_config_free(&config);
		return DB_CLIENT_EXIT_CONFIG;
	}
	if (checks || task.add || task.remove) {
		status = checks ? check(path, &config) :
		                  db_users_administer(&db_opcua_keeper, config.users, &task);
		db_opcua_config_free(&config);
		return status;
	}
	(void)signal(SIGPIPE, SIG_IGN);
	signals = open_signals();
	srand((unsigned)(db_client_wall_us() ^ getpid()));
	server = signals >= 0 ? db_opcua_server_new(&config) : NULL;
	status = server ? run(server, signals) : EXIT_FAILURE;
	db_opcua_server_free(server);
	db_opcua_config_free(&config);
	if (signals >= 0)
		(void)close(signals);
	return status;
}
