"""Studies: a question in a TOML file, its runs, the store that keeps them, and the report.

Where a run goes, in reading order:

- spec: what the TOML file may hold, and the registered things that it names
- cases: truths, manoeuvres and campaigns that a study is tried on; what runs of one process share
- inputs: what drives the machine in a manoeuvre
- tasks: builds the list of runs of a study of either kind, and executes a single run
- runner: run what is missing of a study
- pool: processes on this machine that perform runs, or a cluster; the program of such a process
- store: runs as they are handed on; one SQLite file that holds the planned and the finished ones

The other files: loops (the kind of study that closes the loop), tune (options of identifiers, learnt on other
instances), results (the store as tables), export (the store in formats of others). The report: analyses (statistics, a
file a topic, and the answer), document (facts, and the analyses in the order of the report).
"""
