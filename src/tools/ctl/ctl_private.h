/* SPDX-License-Identifier: Apache-2.0 */
/*
 * What the files of drivebridgectl need of each other, but for larger subjects with headers of
 * their own.
 */
#ifndef DRIVEBRIDGE_CTL_PRIVATE_H
#define DRIVEBRIDGE_CTL_PRIVATE_H

#include "ctl/session.h"

#include <jansson.h>
#include <stdbool.h>
#include <stddef.h>
#include <stdio.h>

/*
 * The commands. Each function gets the arguments after the command's name, as many as the table
 * allows, and returns the exit status.
 */
typedef enum db_ctl_status db_ctl_function(struct db_ctl *ctl, int count, char **arguments);

enum db_ctl_status db_ctl_address(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_alarms(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_alarms_acknowledge(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_audit(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_audit_verify(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_backup(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_baud(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_bus(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_certificate(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_check(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_commission(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_config_back(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_config_check(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_config_set(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_config_show(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_events(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_export(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_get(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_health(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_help(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_history(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_jog(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_metrics(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_names(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_params_diff(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_params_list(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_params_restore(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_params_save(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_position(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_record(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_reload(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_replace(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_restore(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_run(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_scan(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_set(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_show(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_status(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_trace(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_traces(struct db_ctl *ctl, int count, char **arguments);
enum db_ctl_status db_ctl_watch(struct db_ctl *ctl, int count, char **arguments);

/* --- session ---------------------------------------------------------------------------------- */

/* A question to the user at the terminal, before something is done. */

/* DB_CTL_OK: yes, or --yes was given; else the reason is printed. */
enum db_ctl_status db_ctl_ask(const struct db_ctl *ctl, const char *format, ...)
	__attribute__((format(printf, 2, 3)));

/* --- audit ------------------------------------------------------------------------------------ */

/* The option --since, in microseconds since 1970-01-01 UTC: "30m", "2h", "1d" ago, or a date with
 * or without a time of day, in local time; *us stays as it is where it is not given. DB_CTL_OK, or
 * what it has to be is printed. */
enum db_ctl_status db_ctl_read_since(const struct db_ctl *ctl, json_int_t *us);

/* --- backup ----------------------------------------------------------------------------------- */

/*
 * A gateway in one file, for this or another machine: a compressed tar with
 *
 *	gateway                identifies the file: see DB_CTL_BACKUP_HEAD
 *	configuration/...      the folder of the configuration: files, users, profiles, passwords
 *	opcua/...              certificates and keys of drivebridge-opcua, where there are any
 *	parameters/NAME.params of each drive that reported them
 */

#define DB_CTL_CONFIGURATION_FOLDER "/etc/drivebridge"
#define DB_CTL_OPCUA_FOLDER "/var/lib/drivebridge-opcua"
/* The first line of `gateway`; the second one is the name of the main file in the configuration's
 * folder. */
#define DB_CTL_BACKUP_HEAD "drivebridge-backup 1"

/* --- child ------------------------------------------------------------------------------------ */

/* Runs other programs and waits for their end. */

/* True if the program of that name, searched in PATH, exited with 0; `words` ends with NULL.
 * `quiet`: without its standard output. */
bool db_ctl_child_run(char *const words[], bool quiet);

/* --- clients_home ----------------------------------------------------------------------------- */

/* Files of `export` for Home Assistant and Node-RED. */

struct db_ctl_clients;

void db_ctl_write_home_assistant(const struct db_ctl_clients *of, FILE *out);
void db_ctl_write_node_red(const struct db_ctl_clients *of, FILE *out);

/* --- clients_monitor -------------------------------------------------------------------------- */

/* Files for monitoring tools. */

void db_ctl_write_telegraf(const struct db_ctl_clients *of, FILE *out);
void db_ctl_write_prometheus(const struct db_ctl_clients *of, FILE *out);
void db_ctl_write_modbus_exporter(const struct db_ctl_clients *of, FILE *out);
void db_ctl_write_zabbix(const struct db_ctl_clients *of, FILE *out);

/* --- clients_plc ------------------------------------------------------------------------------ */

/* Files for controllers. */

void db_ctl_write_codesys(const struct db_ctl_clients *of, FILE *out);
void db_ctl_write_tia(const struct db_ctl_clients *of, FILE *out);
void db_ctl_write_notation(const struct db_ctl_clients *of, FILE *out);

/* --- clients_scada ---------------------------------------------------------------------------- */

/* Files for SCADA systems. */

void db_ctl_write_kepware(const struct db_ctl_clients *of, FILE *out);
void db_ctl_write_ignition(const struct db_ctl_clients *of, FILE *out);

/* --- csv -------------------------------------------------------------------------------------- */

/* Lines of RFC 4180: commas, a decimal point, quotes where they are needed, CR LF at the end. */

/* The next cell, `first` for the first of its line. NULL: an empty cell. */
void db_ctl_csv_add_text(FILE *file, bool first, const char *text);
/* A number, a boolean (0 or 1) or a text; an unknown value is empty. */
void db_ctl_csv_add_value(FILE *file, bool first, const json_t *value);
void db_ctl_csv_end_line(FILE *file);

/* --- help ------------------------------------------------------------------------------------- */

void db_ctl_print_help(FILE *out);

/* --- learnt ----------------------------------------------------------------------------------- */

/*
 * Prints which longer times a bus has learnt than are configured (adapt = on), and what to write
 * into the configuration. Shorter times are not printed: they cost nothing after a restart. Prints
 * to the standard output.
 */

/* A drive of the description, and the values of its registers; null where it has none. */
struct db_ctl_learnt {
	const json_t *drive;
	const json_t *values;
};

/* Adds the names of the registers that are needed and that the service has. */
void db_ctl_add_learnt_names(json_t *names, const json_t *registers);
/* For those of the drives that are on this bus of the description. */
void db_ctl_print_learnt(const json_t *bus, const struct db_ctl_learnt *drives, size_t count);

/* --- params_restore --------------------------------------------------------------------------- */

/* True if the drive has a memory of its own for its parameters. */
bool db_ctl_params_can_save(struct db_ctl *ctl, const char *drive);

/* --- plot ------------------------------------------------------------------------------------- */

/* Draws a record with gnuplot. */

/* True for a possible picture: "terminal", or a file whose name ends with .svg. */
bool db_ctl_plot_is_picture(const char *picture);

/* Draws the columns of a CSV file from the third on over the first one, which is in seconds.
 * DB_CTL_OK, or the reason is printed. */
enum db_ctl_status db_ctl_plot(const struct db_ctl *ctl, const char *csv, size_t columns,
                               const char *picture);

/* --- ports ------------------------------------------------------------------------------------ */

/* Finds the devices in a configuration's text, and replaces them. Pure. */

/* Adds the words of a text that begin with /dev/, each once, to an array of texts. Comments are
 * skipped. */
void db_ctl_ports_find(const char *text, json_t *ports);

/* The text with other devices: `others` maps each old one to the new one. To be freed; NULL without
 * memory. */
char *db_ctl_ports_replace(const char *text, const json_t *others);

/* --- run -------------------------------------------------------------------------------------- */

/* Goes to a named position, as run DRIVE move_absolute does to another. */
enum db_ctl_status db_ctl_go(struct db_ctl *ctl, const char *drive, const char *position);

/* Commands with words of their own: move, enable, disable, home, clear. */
enum db_ctl_status db_ctl_run_short(struct db_ctl *ctl, int count, char **arguments);

/* --- service ---------------------------------------------------------------------------------- */

/* Where drivebridged is. */
void db_ctl_find_service(char *path, size_t size);

/* --- signals ---------------------------------------------------------------------------------- */

/* Signals as a descriptor to poll, so that output and the terminal can be finished before the
 * end. */

/*
 * Catches SIGINT, SIGTERM, SIGHUP, SIGQUIT, SIGTSTP and SIGWINCH. A descriptor to poll, or -1. From
 * then on none of them ends or stops the program.
 */
int db_ctl_signals_open(void);

/* Restores their former effect. -1 is allowed. */
void db_ctl_signals_close(int fd);

/* The next signal, 0 when there is none. */
int db_ctl_signals_read(int fd);

/* A turn of a command that follows the service until the user ends it: waits for the service or a
 * signal, at most `timeout_ms` (-1: without an end), and takes what the service has sent. 0:
 * nothing came in time; -1: the user ends it. */
int db_ctl_follow(struct db_ctl *ctl, int signals, int timeout_ms);

/* --- stop ------------------------------------------------------------------------------------- */

/* Stops drives: as a command, and for another command whose connection failed or is waiting. */

/* The command `stop`. It needs no open connection, and asks nothing before it stops. */
enum db_ctl_status db_ctl_stop(struct db_ctl *ctl, int count, char **arguments);

/* After this time without a confirmation of a stop, ms, the user is advised to use the emergency
 * stop. */
#define DB_CTL_STOP_WARN_MS 500
void db_ctl_stop_warn(const struct db_ctl *ctl);

/* Over a new connection. 0, or -1 with the error: then only the drive's watchdog is left. */
int db_ctl_stop_drive(const struct db_ctl *ctl, const char *drive, struct db_client_error *error);

/* --- wrap ------------------------------------------------------------------------------------- */

/* Wraps text to the terminal's width. */

/*
 * Prints `text` and a line's end, at most `width` characters per line (0: no limit), broken between
 * words; the first line has `first` blanks before it, the others have `rest`.
 */
void db_ctl_wrap(FILE *out, unsigned width, unsigned first, unsigned rest, const char *text);

/* For an unknown terminal, and for a pager or a file that people read. */
#define DB_CTL_WIDTH 80

/* The characters per line of this terminal; 0: it is no terminal. */
unsigned db_ctl_width(FILE *out);

#endif
