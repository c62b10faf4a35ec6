/* SPDX-License-Identifier: Apache-2.0 */
#include "log/event.h"

/* Number of lines about outages stored per minute: twelve for each drive or port, with their
 * ends. */
#define OUTAGES_KEPT 24

#define KIND(n, i, l, t, m) KEPT(n, i, l, t, m, m)
#define OUTAGE(n, i, l, t, m) KEPT(n, i, l, t, m, OUTAGES_KEPT)
#define KEPT(n, i, l, t, m, k)                                                                     \
	{                                                                                          \
		.name = n, .message_id = i, .level = DB_LOG_##l, .topic = DB_TOPIC_##t, .most = m, \
		.kept = k                                                                          \
	}

/* clang-format off */
static const struct db_event_kind KINDS[DB_EVENT_COUNT] = {
	[DB_EVENT_LISTENING] =
		KIND("listening", "bb6d098457a34ae685a7c7fcff009cea", NOTICE, SERVICE, 0),
	[DB_EVENT_NO_DRIVES] =
		KIND("no-drives", "255aa391a5614efe982633ac537d1d1f", NOTICE, SERVICE, 0),
	[DB_EVENT_FAILED] =
		KIND("failed", "17d014c7211c4bc2922bd3f828f5bb99", ERROR, SERVICE, 0),
	[DB_EVENT_RELOAD] =
		KIND("reload", "e7604e3e7ef84f9d824b1067aee08e7a", NOTICE, SERVICE, 0),
	[DB_EVENT_RELOAD_FAILED] =
		KIND("reload-failed", "0518d97771b04836931103c1f2e047ef", ERROR, SERVICE, 0),
	[DB_EVENT_CONFIG_WRONG] =
		KIND("config-wrong", "a821b9703e19458d9c3c7a04ce267bf2", ERROR, CONFIG, 0),
	[DB_EVENT_CONFIG_CHANGED] =
		KIND("config-changed", "44196f8c8bfb47768d6a7397bdfb894b", NOTICE, CONFIG, 0),
	[DB_EVENT_CONFIG_LAST_GOOD] =
		KIND("config-last-good", "230572368ca3438cb3c4955542f944af", ERROR, CONFIG, 0),
	[DB_EVENT_CONFIG_UNKEPT] =
		KIND("config-unkept", "8d2127c1e73b426d964d1915b446bdc4", WARNING, SERVICE, 0),
	[DB_EVENT_MEMORY_UNLOCKED] =
		KIND("memory-unlocked", "469b25f8e2fa4a6d818fcd4b872f6e30", WARNING, SERVICE, 0),
	[DB_EVENT_THREAD_HANGS] =
		KIND("thread-hangs", "df1869a90aa1460ea0087ded7847191c", ERROR, THREAD, 1),
	[DB_EVENT_LOG_LOST] =
		KIND("log-lost", "fcb78af18563450fadf9bab6b218961a", WARNING, SERVICE, 0),
	[DB_EVENT_CONTROL_FAILED] =
		KIND("control-failed", "731bfa6fa33c433c9c9235a60f94c47a", WARNING, SERVICE, 0),
	[DB_EVENT_SECURE_FAILED] =
		KIND("secure-failed", "42d268393e84462cac6e1dabdcd7d8e9", WARNING, SERVICE, 0),
	[DB_EVENT_SECURE_CHANGED] =
		KIND("secure-changed", "65471320852e456eb86e63aa0dbc3b1b", NOTICE, SERVICE, 6),
	[DB_EVENT_CLIENT_CONNECTED] =
		KIND("client-connected", "4d68edf0a4c14afc87d9198923f2bc17", INFO, CLIENT, 4),
	[DB_EVENT_CLIENT_GONE] =
		KIND("client-gone", "d2b7d6f9a9dc4fb8b1e89d0d913d687b", INFO, CLIENT, 4),
	[DB_EVENT_CLIENT_REFUSED] =
		KIND("client-refused", "2ceb96144aac429996a0d597cdd9743a", WARNING, REFUSAL, 0),
	[DB_EVENT_LINE_UP] =
		OUTAGE("line-up", "0979c31275a24b11aa3e9e612c47d3f2", NOTICE, PORT, 6),
	[DB_EVENT_LINE_LOST] =
		OUTAGE("line-lost", "eab278e9d81944208a190dbb508ee1f4", ERROR, PORT, 6),
	[DB_EVENT_WATCHDOG_TRIPPED] =
		KIND("watchdog-tripped", "f4b126778ab340cabc0126093758deea", ERROR, WATCHDOG, 4),
	[DB_EVENT_HOLD_LOST] =
		KIND("hold-lost", "29faa32dd2aa43349b37fa5a05b85179", WARNING, HOLD, 4),
	[DB_EVENT_BUS_UP] =
		OUTAGE("bus-up", "fed920e4b5ff44ef8ec33d9d7454611f", NOTICE, PORT, 6),
	[DB_EVENT_BUS_BITRATE] =
		KIND("bus-bitrate", "76f7b4c70d6b460a9b871e7b10f5ad9f", WARNING, SETTING, 1),
	[DB_EVENT_BUS_LOST] =
		OUTAGE("bus-lost", "b5177f78e8f24520a6bb84de3caa92cd", ERROR, PORT, 6),
	[DB_EVENT_BUS_OFF] =
		OUTAGE("bus-off", "a69890070d594b00be85c146045a1082", ERROR, PORT, 6),
	[DB_EVENT_BUS_SLOW] =
		KIND("bus-slow", "d843580b97d647409d50b6768c57e229", WARNING, SPEED, 1),
	[DB_EVENT_BUS_ASIDE] =
		OUTAGE("bus-aside", "c61fa48884f1476fa3ff52f79ed7d5ed", NOTICE, PORT, 6),
	[DB_EVENT_PRIORITY_REFUSED] =
		KIND("priority-refused", "2fd87d3fbe5e4def925c2bf0f8c92f05", NOTICE, SERVICE, 0),
	[DB_EVENT_CPUS_REFUSED] =
		KIND("cpus-refused", "2f4ee8b5f0654f178815d8d62d568f59", WARNING, SERVICE, 0),
	[DB_EVENT_SERIAL_LATENCY] =
		KIND("serial-latency", "c68b3d1a4afc4c999fc0ca8119bb83e4", INFO, SETTING, 1),
	[DB_EVENT_DRIVE_ONLINE] =
		OUTAGE("drive-online", "28d1998abc3c409bb624c8b5e83aef24", NOTICE, PRESENCE, 6),
	[DB_EVENT_DRIVE_LOST] =
		OUTAGE("drive-lost", "c7ce0f31624346d39ee387aae97593ed", WARNING, PRESENCE, 6),
	[DB_EVENT_DRIVE_FAULT] =
		KIND("drive-fault", "bf826b86cde64642adc785f038b32bdd", ERROR, FAULT, 4),
	[DB_EVENT_DRIVE_FAULT_GONE] =
		KIND("drive-fault-gone", "a86f6be2faba4a41a20207c8899e51ba", NOTICE, FAULT, 4),
	[DB_EVENT_DRIVE_WARNING] =
		KIND("drive-warning", "9ea9ac46a27c409796d2a6843bdef3af", WARNING, WARNING, 1),
	[DB_EVENT_DRIVE_RESTARTED] =
		KIND("drive-restarted", "bd2b195dc30244519fdda108bcd99585", WARNING, RESTART, 2),
	[DB_EVENT_DRIVE_PARAMS_MISSING] =
		KIND("drive-params-missing", "6e42bbd3dd0e40e9ac2f99decd1f683c", WARNING, SETTING, 1),
	[DB_EVENT_DRIVE_UNCONFIRMED] =
		KIND("drive-unconfirmed", "ee1cac3a828548c99f6f90ee15321fb0", ERROR, EXIT, 0),
	[DB_EVENT_DRIVE_RUNS_ON] =
		KIND("drive-runs-on", "5d0a3a6d0b5a4c0fb6f1c8a36f9a27e4", ERROR, FAULT, 4),
	[DB_EVENT_DRIVE_HEARD] =
		OUTAGE("drive-heard", "c8ae03305b784038be06f2ce841402bd", WARNING, PRESENCE, 6),
	[DB_EVENT_DRIVE_LATE] =
		KIND("drive-late", "3f7c1be3a5b84d0c9d0d5c7f0f4ab1d2", WARNING, TIMING, 1),
	[DB_EVENT_COMMAND_REFUSED] =
		KIND("command-refused", "2a18493d36b646118fe43eab9c581209", WARNING, COMMAND, 4),
	[DB_EVENT_RAW_FRAME] =
		KIND("raw-frame", "cfda7d4890f24adb9c6e25745b56c39a", NOTICE, COMMAND, 0),
	[DB_EVENT_DRIVE_DEAF] =
		KIND("drive-deaf", "a9be1c0de6f54a09a8f3a1f7b3f0c6e5", WARNING, TIMING, 1),
	[DB_EVENT_DRIVE_MAY_HAVE_RESTARTED] =
		KIND("drive-may-have-restarted", "96020b144e0042f29e3f56ead3dd2900", WARNING, RESTART, 2),
	[DB_EVENT_DRIVE_DOUBLED] =
		OUTAGE("drive-doubled", "834fa3d75b44468e9399ab6d01cd1540", ERROR, PRESENCE, 6),
	[DB_EVENT_RESTART_NEEDED] =
		KIND("restart-needed", "46390bef23724437b3a0a51211b66183", NOTICE, SERVICE, 0),
	[DB_EVENT_AUDIT_UNKEPT] =
		KIND("audit-unkept", "8ef4a6280f4c4bbfaf69ba8a363a7695", ERROR, AUDIT, 4),
	[DB_EVENT_AUDIT_KEPT] =
		KIND("audit-kept", "2dea4b65aeed403083e4bccb271f3694", NOTICE, AUDIT, 4),
	[DB_EVENT_HEALTH_UNKEPT] =
		KIND("health-unkept", "e0b920204ddf4f40b4f4cba367396891", WARNING, HEALTH, 4),
	[DB_EVENT_HEALTH_KEPT] =
		KIND("health-kept", "bfa55bbfb08d44ecaf1596fedbf71fcd", NOTICE, HEALTH, 4),
};
/* clang-format on */

const struct db_event_kind *db_event_kind(enum db_event event)
{
	return &KINDS[event];
}

const char *db_event_name(enum db_event event)
{
	return KINDS[event].name;
}

enum db_log_level db_event_level(enum db_event event)
{
	return KINDS[event].level;
}
