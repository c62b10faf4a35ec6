/* SPDX-License-Identifier: Apache-2.0 */
#include "sim/vsmd_drive.h"
#include "sim/vsmd_mechanics.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

#define SECOND DB_NS_PER_S

/* A drive and its clock. */
struct bench {
	struct sim_vsmd_config config;
	struct sim_vsmd *drive;
	db_time now;
};

static void power_on(struct bench *bench)
{
	bench->drive = sim_vsmd_new(&bench->config, bench->now);
	assert_non_null(bench->drive);
}

static struct bench bench(void)
{
	struct bench made = { .now = 1000 * SECOND };

	sim_vsmd_config_init(&made.config, 1, 9600);
	return made;
}

static struct vsmd_status status(struct bench *bench)
{
	struct vsmd_status result;

	sim_vsmd_status(bench->drive, bench->now, &result);
	return result;
}

static bool bit(struct bench *bench, uint32_t mask)
{
	return (status(bench).status & mask) != 0;
}

/* Sends a line as RS232 would carry it; true unless it was refused. */
static bool send(struct bench *bench, const char *line)
{
	struct vsmd_setting settings[8];
	struct vsmd_command command;
	enum vsmd_error error = vsmd_serial_decode_command(line, strlen(line), false, &command,
	                                                   settings, 8);

	if (error == VSMD_OK)
		(void)sim_vsmd_execute(bench->drive, &command, bench->now);
	else
		sim_vsmd_refuse(bench->drive, bench->now);
	return !bit(bench, VSMD_ST_CMD_WRG);
}

static void wait_seconds(struct bench *bench, double seconds)
{
	bench->now += (db_time)(seconds * 1e9);
}

static void moves_and_counts(void **state)
{
	struct bench b = bench();

	(void)state;
	power_on(&b);
	assert_true(bit(&b, VSMD_ST_STP) && bit(&b, VSMD_ST_ORG) && !bit(&b, VSMD_ST_HS));
	assert_true(send(&b, "dev") && bit(&b, VSMD_ST_HS));
	assert_true(send(&b, "ena") && bit(&b, VSMD_ST_PWR));
	assert_true(send(&b, "pos 1000 spd=5000"));
	wait_seconds(&b, 0.05);
	assert_false(bit(&b, VSMD_ST_STP));
	assert_true(status(&b).velocity > 1199.0f && status(&b).velocity < 1201.0f);
	wait_seconds(&b, 2);
	assert_int_equal(status(&b).position, 1000);
	assert_true(bit(&b, VSMD_ST_STP) && !bit(&b, VSMD_ST_ORG));
	assert_true(send(&b, "rmv -300"));
	assert_true(send(&b, "rmv -300")); /* relative to where it is now: not added up */
	wait_seconds(&b, 2);
	assert_int_equal(status(&b).position, 700);
	assert_int_equal(b.drive->counts[VSMD_RMV], 2);
	free(b.drive);
}

static void refuses_and_forgives(void **state)
{
	struct bench b = bench();

	(void)state;
	power_on(&b);
	assert_false(send(&b, "mov"));
	assert_false(send(&b, "pos 5"));
	assert_false(send(&b, "zero start"));
	assert_true(send(&b, "ena"));
	assert_false(send(&b, "frobnicate"));
	assert_true(send(&b, "sts"));
	assert_false(send(&b, "cfg spd=192001"));
	assert_false(send(&b, "cfg cra=2.6"));
	assert_false(send(&b, "cfg acc=1 emod=1")); /* open loop; and then acc stays too */
	assert_true(b.drive->params[VSMD_ACC].f == 24000.0f);
	assert_false(send(&b, "s3 on"));    /* an input */
	assert_false(send(&b, "cfg s1=1")); /* 025T: ports 3 to 6 only */
	assert_true(send(&b, "cfg s3=1"));
	assert_false(bit(&b, VSMD_ST_S3));
	assert_true(send(&b, "s3 on") && bit(&b, VSMD_ST_S3));
	assert_true(send(&b, "s3 off") && !bit(&b, VSMD_ST_S3));
	assert_false(send(&b, "sv1 100"));
	assert_false(send(&b, "eclr"));
	assert_true(send(&b, "org 2147483000"));
	assert_false(send(&b, "rmv 1000"));
	assert_int_equal(status(&b).position, 2147483000);
	free(b.drive);
}

static void off_loses_the_origin(void **state)
{
	struct bench b = bench();

	(void)state;
	power_on(&b);
	send(&b, "ena");
	send(&b, "org 4000");
	assert_int_equal(status(&b).position, 4000);
	assert_false(bit(&b, VSMD_ST_ORG));
	send(&b, "mov spd=1000");
	wait_seconds(&b, 1);
	assert_true(send(&b, "off"));
	assert_int_equal(status(&b).position, 0);
	assert_true(status(&b).velocity == 0.0f);
	assert_true(bit(&b, VSMD_ST_ORG) && bit(&b, VSMD_ST_STP) && !bit(&b, VSMD_ST_PWR));
	free(b.drive);
}

static void soft_limits_hold(void **state)
{
	struct bench b = bench();

	(void)state;
	power_on(&b);
	send(&b, "ena");
	assert_true(send(&b, "cfg sml=-2000 spl=3000"));
	send(&b, "pos 100000");
	wait_seconds(&b, 20);
	assert_int_equal(status(&b).position, 3000);
	send(&b, "org 3001");
	assert_true(send(&b, "pos 0"));
	assert_true(bit(&b, VSMD_ST_STP));
	wait_seconds(&b, 5);
	assert_int_equal(status(&b).position, 3001);
	free(b.drive);
}

static void limit_sensor_stops_one_direction(void **state)
{
	struct bench b = bench();

	(void)state;
	b.config.sensors[2] = (struct sim_sensor){ .kind = SIM_SENSOR_BELOW, .low = -1000.0 };
	b.config.defaults[VSMD_MSR].u = 3;
	power_on(&b);
	send(&b, "ena");
	send(&b, "mov spd=-2000");
	wait_seconds(&b, 10);
	assert_true(bit(&b, VSMD_ST_STP) && bit(&b, VSMD_ST_S3));
	assert_in_range(-status(&b).position, 999, 1001);
	send(&b, "pos -5000");
	wait_seconds(&b, 10);
	assert_in_range(-status(&b).position, 999, 1001);
	send(&b, "pos 10");
	wait_seconds(&b, 10);
	assert_int_equal(status(&b).position, 10);
	free(b.drive);
}

static void check_homing(uint32_t mode, int32_t rest, uint32_t negative_limit)
{
	struct bench b = bench();

	b.config.start = 5000.0;
	b.config.sensors[3] = (struct sim_sensor){ .kind = SIM_SENSOR_BELOW, .low = 1000.0 };
	b.config.defaults[VSMD_ZMD].u = mode;
	b.config.defaults[VSMD_SNR].u = 3;
	b.config.defaults[VSMD_ZSD].f = -4000.0f;
	b.config.defaults[VSMD_ZSP].i = 2400;
	b.config.defaults[VSMD_MSR].u = negative_limit;
	power_on(&b);
	send(&b, "ena");
	assert_true(send(&b, "zero start"));
	assert_false(bit(&b, VSMD_ST_ZERO));
	wait_seconds(&b, 30);
	assert_true(bit(&b, VSMD_ST_ZERO) && bit(&b, VSMD_ST_STP) && bit(&b, VSMD_ST_ACT));
	assert_int_equal(status(&b).position, rest);
	assert_in_range(sim_mechanics_shaft(b.drive) - rest, 998, 1002);

	/* Not again before zero stop; afterwards from inside the sensor too. */
	send(&b, "pos -500");
	wait_seconds(&b, 10);
	assert_true(send(&b, "zero start"));
	assert_true(bit(&b, VSMD_ST_ZERO) && bit(&b, VSMD_ST_STP));
	assert_true(send(&b, "zero stop") && !bit(&b, VSMD_ST_ZERO));
	assert_true(send(&b, "zero start") && !bit(&b, VSMD_ST_STP));
	wait_seconds(&b, 30);
	assert_true(bit(&b, VSMD_ST_ZERO));
	assert_in_range(sim_mechanics_shaft(b.drive) - rest, 998, 1002);
	free(b.drive);
}

static void homing_finds_the_origin(void **state)
{
	(void)state;
	check_homing(1, 0, 0);
	check_homing(2, 2400, 0);
	check_homing(3, 0, 0);
	check_homing(4, 2400, 0);
	check_homing(3, 0, 4); /* one sensor as origin and limit */
}

static void homing_can_be_stopped_and_fail(void **state)
{
	struct bench b = bench();

	(void)state;
	b.config.defaults[VSMD_ZMD].u = 1;
	b.config.defaults[VSMD_SNR].u = 3; /* never active */
	power_on(&b);
	send(&b, "ena");
	send(&b, "zero start");
	wait_seconds(&b, 3);
	assert_true(send(&b, "zero stop"));
	wait_seconds(&b, 3);
	assert_true(bit(&b, VSMD_ST_STP) && !bit(&b, VSMD_ST_ZERO));
	assert_true(send(&b, "cfg zmd=0"));
	assert_false(send(&b, "zero start"));
	assert_false(send(&b, "cfg zmd=6")); /* closed loop only */
	free(b.drive);
}

static void homing_by_encoder(void **state)
{
	struct bench b = bench();

	(void)state;
	b.config.closed_loop = true;
	b.config.defaults[VSMD_EMOD].u = 2;
	b.config.travel_min = -3000.0;
	b.config.defaults[VSMD_ZMD].u = 6;
	power_on(&b);
	send(&b, "ena");
	send(&b, "zero start");
	wait_seconds(&b, 10);
	assert_true(bit(&b, VSMD_ST_ZERO) && !bit(&b, VSMD_ST_ENC_ERR));
	assert_int_equal(status(&b).position, 0);
	assert_in_range(-sim_mechanics_shaft(b.drive), 3000, 3000);

	assert_true(send(&b, "cfg zmd=7 zsd=1600") && send(&b, "zero stop") &&
	            send(&b, "zero start"));
	wait_seconds(&b, 20);
	assert_true(bit(&b, VSMD_ST_ZERO));
	assert_in_range(sim_mechanics_shaft(b.drive) + 1, 1, 1); /* a whole turn: 200 steps of 32 */
	free(b.drive);
}

static void sensor_events_act(void **state)
{
	struct bench b = bench();

	(void)state;
	b.config.sensors[4] = (struct sim_sensor){ .kind = SIM_SENSOR_ABOVE, .low = 2000.0 };
	power_on(&b);
	send(&b, "ena");
	assert_true(send(&b, "cfg s5r=4"));
	send(&b, "mov spd=3000");
	wait_seconds(&b, 5);
	assert_true(bit(&b, VSMD_ST_STP) && bit(&b, VSMD_ST_S5));
	assert_in_range(status(&b).position, 1999, 2001);

	send(&b, "pos 5000");
	wait_seconds(&b, 5);
	assert_true(send(&b, "cfg s5f=3")); /* leaving: brake, then this place is 0 */
	send(&b, "mov spd=-3000");
	wait_seconds(&b, 5);
	assert_true(bit(&b, VSMD_ST_STP) && bit(&b, VSMD_ST_ORG) && !bit(&b, VSMD_ST_S5));
	assert_int_equal(status(&b).position, 0);
	assert_true(sim_mechanics_shaft(b.drive) < 1999.0);

	assert_true(send(&b, "cfg s4r=6 s4f=2 s3r=8 s3f=9"));
	sim_vsmd_force_sensor(b.drive, 4, 1, b.now);
	wait_seconds(&b, 0.1);
	assert_true(status(&b).velocity > 0.0f);
	sim_vsmd_force_sensor(b.drive, 4, 0, b.now);
	wait_seconds(&b, 2);
	assert_true(bit(&b, VSMD_ST_STP));
	sim_vsmd_force_sensor(b.drive, 3, 1, b.now);
	assert_true(bit(&b, VSMD_ST_ACTION));
	sim_vsmd_force_sensor(b.drive, 3, 0, b.now);
	assert_false(bit(&b, VSMD_ST_ACTION));
	free(b.drive);
}

static void shake_ends_after_its_cycles(void **state)
{
	struct bench b = bench();

	(void)state;
	power_on(&b);
	send(&b, "ena");
	assert_true(send(&b, "shake start spos=100 epos=300 freq=2.0 cycles=4"));
	wait_seconds(&b, 1.5);
	assert_false(bit(&b, VSMD_ST_STP) || bit(&b, VSMD_ST_ACT));
	wait_seconds(&b, 2);
	assert_true(bit(&b, VSMD_ST_STP) && bit(&b, VSMD_ST_ACT));
	assert_int_equal(status(&b).position, 100);
	assert_true(send(&b, "shake start spos=100 epos=300 freq=2.0 time=0"));
	wait_seconds(&b, 60);
	assert_false(bit(&b, VSMD_ST_STP));
	assert_true(send(&b, "shake stop"));
	wait_seconds(&b, 1);
	assert_true(bit(&b, VSMD_ST_STP) && !bit(&b, VSMD_ST_ACT));
	free(b.drive);
}

static void blocked_motor(void **state)
{
	struct bench open = bench();
	struct bench closed = bench();

	(void)state;
	power_on(&open);
	send(&open, "ena");
	sim_vsmd_advance(open.drive, open.now);
	open.drive->stalled = true;
	send(&open, "pos 500");
	wait_seconds(&open, 5);
	assert_int_equal(status(&open).position, 500); /* it does not know */
	assert_in_range(sim_mechanics_shaft(open.drive) + 1, 1, 1);
	free(open.drive);

	closed.config.closed_loop = true;
	closed.config.defaults[VSMD_EMOD].u = 1;
	power_on(&closed);
	send(&closed, "ena");
	sim_vsmd_advance(closed.drive, closed.now);
	closed.drive->stalled = true;
	send(&closed, "pos 500");
	wait_seconds(&closed, 5);
	assert_true(bit(&closed, VSMD_ST_ENC_ERR) && bit(&closed, VSMD_ST_STP));
	assert_int_equal(status(&closed).position, 0);
	sim_vsmd_advance(closed.drive, closed.now);
	closed.drive->stalled = false;
	assert_true(send(&closed, "eclr") && !bit(&closed, VSMD_ST_ENC_ERR));
	send(&closed, "pos 500");
	wait_seconds(&closed, 5);
	assert_int_equal(status(&closed).position, 500);
	free(closed.drive);
}

static void flash_outlives_power(void **state)
{
	char directory[] = "/tmp/sim-flash-XXXXXX";
	char path[64];
	struct bench b = bench();

	(void)state;
	assert_non_null(mkdtemp(directory));
	(void)snprintf(path, sizeof(path), "%s/d.flash", directory);
	b.config.flash_path = path;
	power_on(&b);
	assert_true(send(&b, "cfg spd=777.5 cid=7 pae=1"));
	assert_int_equal(b.drive->address, 1);
	sim_vsmd_power(b.drive, false, b.now);
	sim_vsmd_power(b.drive, true, b.now);
	assert_true(b.drive->params[VSMD_SPD].f == 6400.0f); /* not saved */

	assert_true(send(&b, "cfg spd=777.5 cid=7 pae=1"));
	b.drive->flash_fails = true;
	assert_true(send(&b, "sav") && bit(&b, VSMD_ST_FLASH_ERR));
	b.drive->flash_fails = false;
	assert_true(send(&b, "sav") && !bit(&b, VSMD_ST_FLASH_ERR));
	assert_int_equal(b.drive->address, 1); /* until the next power-up */
	free(b.drive);

	power_on(&b); /* a new process */
	assert_int_equal(b.drive->address, 7);
	assert_true(b.drive->params[VSMD_SPD].f == 777.5f);
	assert_true(bit(&b, VSMD_ST_PWR) && !bit(&b, VSMD_ST_HS));
	free(b.drive);
	assert_int_equal(unlink(path), 0);
	b.config.flash_path = directory; /* cannot be read or replaced */
	power_on(&b);
	assert_true(bit(&b, VSMD_ST_FLASH_ERR));
	assert_true(send(&b, "sav") && bit(&b, VSMD_ST_FLASH_ERR));
	free(b.drive);
	assert_int_equal(rmdir(directory), 0);
}

int main(void)
{
	const struct CMUnitTest tests[] = {
		cmocka_unit_test(moves_and_counts),
		cmocka_unit_test(refuses_and_forgives),
		cmocka_unit_test(off_loses_the_origin),
		cmocka_unit_test(soft_limits_hold),
		cmocka_unit_test(limit_sensor_stops_one_direction),
		cmocka_unit_test(homing_finds_the_origin),
		cmocka_unit_test(homing_can_be_stopped_and_fail),
		cmocka_unit_test(homing_by_encoder),
		cmocka_unit_test(sensor_events_act),
		cmocka_unit_test(shake_ends_after_its_cycles),
		cmocka_unit_test(blocked_motor),
		cmocka_unit_test(flash_outlives_power),
	};

	return cmocka_run_group_tests_name("sim/vsmd_drive", tests, NULL, NULL);
}
