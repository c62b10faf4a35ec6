/* SPDX-License-Identifier: Apache-2.0 */
/* Configuration file, real ptys, and the control commands on top of them. */
#include "sim/commands.h"
#include "sim/vsmd_mechanics.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cmocka.h>

#define GOOD                      \
	"bus b { baud = 9600 }\n" \
	"drive d { bus = b\n address = 4\n sensor = {\"3:below:-10\"}\n set = {\"spd=100\"} }\n"

/* Loads a text as configuration file; what was reported goes to `errors`. */
static int load(const char *text, struct sim_config *config, char *errors, size_t size)
{
	char path[] = "/tmp/sim-config-XXXXXX";
	int fd = mkstemp(path);
	FILE *sink = tmpfile();
	int saved = dup(STDERR_FILENO);
	size_t length;
	int result;

	assert_true(fd >= 0 && saved >= 0 && sink);
	assert_int_equal(write(fd, text, strlen(text)), strlen(text));
	(void)fflush(stderr);
	assert_true(dup2(fileno(sink), STDERR_FILENO) >= 0);
	result = sim_config_load(path, config);
	(void)fflush(stderr);
	assert_true(dup2(saved, STDERR_FILENO) >= 0);
	rewind(sink);
	length = fread(errors, 1, size - 1, sink);
	errors[length] = '\0';
	(void)fclose(sink);
	(void)close(saved);
	(void)close(fd);
	(void)unlink(path);
	return result;
}

static void assert_refused(const char *text, const char *line, const char *message)
{
	struct sim_config config;
	char errors[1024];

	assert_int_equal(load(text, &config, errors, sizeof(errors)), -1);
	if (!strstr(errors, line) || !strstr(errors, message))
		fail_msg("\"%s\" lacks \"%s\" or \"%s\"", errors, line, message);
}

static void bad_configurations_are_explained(void **state)
{
	(void)state;
	assert_refused("bus b { baud = 9600\n colour = red }", ":2:", "no such option 'colour'");
	assert_refused("bus b { baud = 9600\n colour = red }",
	               ":2:", "known here: protocol device");
	assert_refused("bus b {\n baud = 1200\n }\ndrive d { bus = b }", ":2:", "2400 to 921600");
	assert_refused("bus b {\n line = rs422 }\ndrive d { bus = b }", ":2:", "rs485, rs232");
	assert_refused("bus b { }\ndrive d {\n bus = c }", ":3:", "\"c\" does not exist");
	assert_refused("bus b { }\ndrive d { bus = b\n address = 33 }", ":3:", "1 to 32");
	assert_refused("bus b { }\ndrive d { bus = b }\ndrive e { bus = b\n address = 1 }",
	               ":4:", "taken by drive d");
	assert_refused(
		"bus b { line = rs232 }\ndrive d { bus = b }\ndrive e { bus = b\n address = 2 }",
		":3:", "only one");
	assert_refused("bus b { }\ndrive d { bus = b\n sensor = {\"7:below:1\"} }",
	               ":3:", "N:below:POS");
	assert_refused("bus b { }\ndrive d { bus = b\n set = {\"spd=1e9\"} }",
	               ":3:", "set \"spd=1e9\"");
	assert_refused("bus b { }\ndrive d { bus = b\n set = {\"nope=1\"} }", ":3:", "NAME=VALUE");
	assert_refused("bus b { }\ndrive d { bus = b\n set = {\"emod=1\"} }",
	               ":3:", "for this model");
	assert_refused("bus b { }\ndrive d { bus = b\n fault = {\"boom\"} }",
	               ":3:", "there are drop");
	assert_refused("bus b { }\n", "", "at least one");
}

struct bench {
	struct sim_config config;
	struct sim_world world;
	db_time now;
	char answer[16384];
};

static int setup(void **state)
{
	static struct bench bench;
	char errors[256];

	bench = (struct bench){ .now = DB_NS_PER_S };
	assert_int_equal(load(GOOD, &bench.config, errors, sizeof(errors)), 0);
	assert_int_equal(sim_world_open(&bench.world, &bench.config, NULL, bench.now), 0);
	*state = &bench;
	return 0;
}

static int teardown(void **state)
{
	struct bench *bench = *state;

	sim_world_close(&bench->world);
	sim_config_free(&bench->config);
	return 0;
}

static const char *ask(struct bench *bench, const char *command)
{
	char line[256];
	FILE *out = fmemopen(bench->answer, sizeof(bench->answer), "w");

	assert_non_null(out);
	(void)snprintf(line, sizeof(line), "%s", command);
	sim_command(&bench->world, line, bench->now, out);
	assert_int_equal(fclose(out), 0);
	return bench->answer;
}

/* Puts a request on the simulated wire and lets time run until all is quiet. */
static void host_sends(struct bench *bench, const char *line)
{
	struct sim_serial_bus *wire = bench->world.buses[0].wire;

	sim_serial_bus_receive(wire, (const uint8_t *)line, strlen(line), bench->now);
	while (sim_serial_bus_next(wire) != DB_TIME_NEVER) {
		bench->now = sim_serial_bus_next(wire);
		sim_world_run(&bench->world, bench->now);
	}
}

static void errors_are_answered(void **state)
{
	struct bench *b = *state;
	static const char *const wrong[] = {
		"",
		"dance",
		"fault",
		"fault x drop",
		"fault d",
		"fault d echo on",
		"fault d drop no",
		"power d",
		"power b on",
		"power d maybe",
		"address d 0",
		"identity d",
		"flash d maybe",
		"stall d maybe",
		"sensor d 7 1",
		"sensor d 1",
		"sensor d 1 2",
		"bits d x",
		"baud d 9600",
		"baud b 1",
		"get z",
		"log b",
	};

	for (size_t i = 0; i < sizeof(wrong) / sizeof(wrong[0]); i++) {
		if (strncmp(ask(b, wrong[i]), "error ", 6) != 0)
			fail_msg("\"%s\" was answered \"%s\"", wrong[i], b->answer);
	}
}

static void commands_reach_the_drive(void **state)
{
	struct bench *b = *state;

	host_sends(b, "4 ena\n");
	host_sends(b, "4 pos 40\n");
	b->now += 5 * DB_NS_PER_S;
	assert_non_null(strstr(ask(b, "get d"), "ok position=40 "));
	assert_non_null(strstr(b->answer, " pos=1 rmv=0 "));
	assert_non_null(strstr(ask(b, "log d"), " 4 pos 40\nok\n"));
	assert_string_equal(ask(b, "bits d 0x40"), "ok\n");
	assert_non_null(strstr(ask(b, "get d"), "status=0x00002173"));
	assert_string_equal(ask(b, "bits d 0"), "ok\n");
	assert_string_equal(ask(b, "sensor d 4 1"), "ok\n");
	assert_non_null(strstr(ask(b, "get d"), "status=0x0000213b"));
	assert_string_equal(ask(b, "sensor d 4 auto"), "ok\n");
	assert_string_equal(ask(b, "power d cycle"), "ok\n");
	assert_non_null(strstr(ask(b, "get d"), "ok position=0 "));
	assert_string_equal(ask(b, "power d off"), "ok\n");
	host_sends(b, "4 sts\n");
	assert_non_null(strstr(ask(b, "get b"), "unheard=1"));
	assert_string_equal(ask(b, "power d on"), "ok\n");
	assert_string_equal(ask(b, "identity d VSMD999 new"), "ok\n");
	assert_string_equal(b->world.nodes[0].drive->identity, "VSMD999 new");
	assert_string_equal(ask(b, "address d 5"), "ok\n");
	host_sends(b, "4 sts\n");
	assert_non_null(strstr(ask(b, "get d"), "heard=2 replies=2"));
	assert_string_equal(ask(b, "address d 4"), "ok\n");
	assert_string_equal(ask(b, "fault d drop 1"), "ok\n");
	host_sends(b, "4 sts\n");
	assert_non_null(strstr(ask(b, "get d"), "heard=3 replies=2"));
	assert_string_equal(ask(b, "fault b silence on"), "ok\n");
	assert_string_equal(ask(b, "fault b none"), "ok\n");
	assert_string_equal(ask(b, "flash d fail"), "ok\n");
	host_sends(b, "4 sav\n");
	assert_int_equal(b->world.nodes[0].drive->counts[VSMD_SAV], 1);
	assert_non_null(strstr(ask(b, "get d"), "status=0x000005b3"));
	assert_non_null(strstr(ask(b, "list"), "drive d 4\nok\n"));
}

static void links_come_and_go(void **state)
{
	char directory[] = "/tmp/sim-link-XXXXXX";
	char path[64];
	struct sim_port port;
	FILE *file;

	(void)state;
	assert_non_null(mkdtemp(directory));
	(void)snprintf(path, sizeof(path), "%s/bus", directory);
	assert_int_equal(symlink("/nowhere", path), 0); /* left by one that was killed */
	assert_int_equal(sim_port_open(&port, "pty", 9600, NULL, path), 0);
	assert_int_equal(access(path, R_OK | W_OK), 0);
	sim_port_close(&port);
	file = fopen(path, "wx"); /* the link is gone, and a real file is left alone */
	assert_non_null(file);
	(void)fclose(file);
	assert_true(sim_port_open(&port, "pty", 9600, NULL, path) < 0);
	assert_int_equal(unlink(path), 0);
	assert_int_equal(rmdir(directory), 0);
}

static void a_folder_has_links_to_ptys(void **state)
{
	char directory[] = "/tmp/sim-links-XXXXXX";
	char path[64];
	char errors[256];
	struct sim_config config;
	struct sim_world world = { .buses = NULL };

	(void)state;
	assert_non_null(mkdtemp(directory));
	(void)snprintf(path, sizeof(path), "%s/b", directory);
	assert_int_equal(load("bus b { }\ndrive d { bus = b }", &config, errors, sizeof(errors)),
	                 0);
	config.buses[0].folder = directory;
	assert_int_equal(sim_world_open(&world, &config, NULL, 0), 0);
	assert_int_equal(access(path, R_OK | W_OK), 0);
	sim_world_close(&world);
	assert_int_not_equal(access(path, F_OK), 0);
	sim_config_free(&config);
	assert_int_equal(rmdir(directory), 0);
}

static void a_pty_is_given_to_a_group(void **state)
{
	const gid_t own = getegid();
	struct sim_port port;
	struct stat status;

	(void)state;
	assert_int_equal(sim_port_open(&port, "pty", 9600, &own, NULL), 0);
	assert_int_equal(stat(port.host, &status), 0);
	assert_int_equal(status.st_gid, own);
	assert_int_equal(status.st_mode & 0777, 0660);
	sim_port_close(&port);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(bad_configurations_are_explained),
		cmocka_unit_test_setup_teardown(errors_are_answered, setup, teardown),
		cmocka_unit_test_setup_teardown(commands_reach_the_drive, setup, teardown),
		cmocka_unit_test(links_come_and_go),
		cmocka_unit_test(a_folder_has_links_to_ptys),
		cmocka_unit_test(a_pty_is_given_to_a_group),
	};

	return cmocka_run_group_tests_name("sim/commands", tests, NULL, NULL);
}
